-- An object's box is within $within_distance metres of a pedestrian crossing, or on it.
-- within_distance = 1.0
WITH near AS (
    SELECT scenario_id, track_id, list({'xs': xs, 'ys': ys}) AS outlines
    FROM walks JOIN map_areas USING (dataset, version, map_id)
    WHERE
        feature_type = 'CROSSWALK'
        AND min_x <= "right" + (length + $within_distance) AND max_x >= "left" - (length + $within_distance) AND min_y <= high + (length + $within_distance) AND max_y >= low - (length + $within_distance)
    GROUP BY scenario_id, track_id
),
gaps AS (
    SELECT
        scenario_id, track_id, unnest(timesteps) AS timestep,
        unnest(outline_gaps(steps, outlines, true, $within_distance)) AS gap
    FROM walks JOIN near USING (scenario_id, track_id)
)
SELECT scenario_id, track_id, timestep
FROM gaps
WHERE gap <= $within_distance
