-- A pedestrian crosses the ego's path in front of it: from one side to the other, at most $max_ahead metres ahead of
-- the ego's front along the path, and the ego comes within $within seconds or has not moved on when the recording ends.
-- Lasts while the pedestrian is within the 3.5 m wide corridor around the path; value is the smallest distance from the
-- ego's front, in m.
-- Source: the crossing pedestrian of Euro NCAP's tests (CPNA, CPFA), with the ego's recorded path as the lane.
-- max_ahead = 30.0
-- within = 10.0
WITH on_path AS (
    SELECT
        *,
        ahead - ego_length / 2 AS clear,
        timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM ego_corridor
    WHERE object_type = 'PEDESTRIAN' AND abs("left") <= 1.75 AND ahead > ego_length / 2
)
SELECT
    scenario_id,
    track_id,
    ego_id AS other_id,
    min(timestep) AS first_timestep,
    max(timestep) AS last_timestep,
    min(clear) AS value
FROM on_path
GROUP BY scenario_id, track_id, ego_id, run
HAVING
    min("left") < -0.5 AND max("left") > 0.5 AND min(clear) <= $max_ahead
    AND coalesce(min(ego_passes - seconds), 0) <= $within
