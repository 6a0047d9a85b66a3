-- hard: No object is farther than 10 km from the ego's path, larger than 200 m or recorded to be faster than 150 m/s.
WITH egos AS (
    SELECT
        scenario_id,
        list_min(x) AS min_x, list_max(x) AS max_x,
        list_min(y) AS min_y, list_max(y) AS max_y
    FROM metadata_rows
    JOIN tracks USING (scenario_id)
    WHERE track_id = ego_id
),
extremes AS (
    SELECT
        scenario_id,
        track_id,
        greatest(list_max(x) - min_x, max_x - list_min(x), list_max(y) - min_y, max_y - list_min(y)) AS distance,
        greatest(list_max(length), list_max(width), list_max(height)) AS size,
        CASE
            WHEN is_velocity_estimated THEN 0  -- nobody_teleports
            ELSE greatest(list_max(vx), -list_min(vx), list_max(vy), -list_min(vy))
        END AS speed
    FROM tracks
    JOIN egos USING (scenario_id)
)
SELECT
    scenario_id,
    'track ' || track_id || CASE
        WHEN distance > 10000 THEN printf(' is %.4g m from the ego, expected up to 10000', distance)
        WHEN size > 200 THEN printf(' has a size of %.4g m, expected up to 200', size)
        ELSE printf(' has a speed of %.4g m/s, expected up to 150', speed)
    END AS detail
FROM extremes
WHERE distance > 10000 OR size > 200 OR speed > 150;
