-- An object's centre is on a lane that is in an intersection, or within $threshold metres of it.
-- threshold = 5.0
WITH near AS (
    SELECT scenario_id, track_id, list({'xs': xs, 'ys': ys}) AS outlines
    FROM walks JOIN lane_outlines USING (dataset, version, map_id)
    WHERE
        is_intersection
        AND min_x <= "right" + $threshold AND max_x >= "left" - $threshold AND min_y <= high + $threshold AND max_y >= low - $threshold
    GROUP BY scenario_id, track_id
),
gaps AS (
    SELECT
        scenario_id, track_id, unnest(timesteps) AS timestep,
        unnest(outline_gaps(steps, outlines, false, $threshold)) AS gap
    FROM walks JOIN near USING (scenario_id, track_id)
)
SELECT scenario_id, track_id, timestep
FROM gaps
WHERE gap <= $threshold
