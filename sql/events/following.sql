-- The ego follows one vehicle for at least $min_duration seconds: it is the nearest ahead on the ego's path, both move
-- faster than 1 m/s, and the headway from front to front is at most $max_headway seconds. Value is the mean headway, in
-- s.
-- Source: Highway Capacity Manual 2000, percent time spent following: a headway of less than 3 s.
-- max_headway = 3.0
-- min_duration = 2.0
WITH following AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM ego_leads
    WHERE least(speed, ego_speed) > 1 AND headway <= $max_headway
)
SELECT
    scenario_id,
    ego_id AS track_id,
    track_id AS other_id,
    min(timestep) AS first_timestep,
    max(timestep) AS last_timestep,
    avg(headway) AS value
FROM following
GROUP BY scenario_id, ego_id, following.track_id, run
HAVING max(seconds) - min(seconds) >= $min_duration
