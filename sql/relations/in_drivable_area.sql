-- An object's centre is in an area where vehicles may drive.
WITH near AS (
    SELECT scenario_id, track_id, list({'xs': xs, 'ys': ys}) AS outlines
    FROM walks JOIN map_areas USING (dataset, version, map_id)
    WHERE
        feature_type = 'DRIVABLE_AREA'
        AND min_x <= "right" AND max_x >= "left" AND min_y <= high AND max_y >= low
    GROUP BY scenario_id, track_id
),
gaps AS (
    SELECT
        scenario_id, track_id, unnest(timesteps) AS timestep,
        unnest(outline_gaps(steps, outlines, false, 0)) AS gap
    FROM walks JOIN near USING (scenario_id, track_id)
)
SELECT scenario_id, track_id, timestep
FROM gaps
WHERE gap <= 0
