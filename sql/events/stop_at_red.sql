-- A vehicle waits at a red light of its lane for at least $min_duration seconds: slower than 0.5 m/s, its front at most
-- $max_before metres before the stop line; ego_only=true considers only the ego. Value is the smallest distance from
-- its front to the line, in m.
-- Source: the tag stationary_at_traffic_light of nuPlan; red as in the Waymo Open Sim Agents metrics (STOP and
-- ARROW_STOP).
-- max_before = 8.0
-- min_duration = 1.0
-- ego_only = false
WITH standing AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id, light_id, lane_id ORDER BY timestep) AS run
    FROM at_red
    WHERE
        speed < 0.5 AND before BETWEEN -2 AND $max_before  -- vehicles often stop slightly beyond the line
        AND (track_id = ego_id OR NOT $ego_only)
),
stops AS (
    SELECT
        scenario_id, track_id, run,
        min(timestep) AS first_timestep,
        max(timestep) AS last_timestep,
        min(before) AS value
    FROM standing
    GROUP BY scenario_id, track_id, light_id, lane_id, run
    HAVING max(seconds) - min(seconds) >= $min_duration - 1e-6
)
SELECT
    scenario_id,
    track_id,
    NULL::VARCHAR AS other_id,
    first_timestep,
    last_timestep,
    min(value) AS value  -- lanes that diverge at one stop line have a light each
FROM stops
GROUP BY scenario_id, track_id, first_timestep, last_timestep
