-- A vehicle's front crosses the stop line of its lane while the light has been red for $min_red seconds, faster than
-- $min_speed m/s; ego_only=true considers only the ego. The timesteps are those before and after the crossing; value is
-- the speed, in m/s. Permitted turns on red count, too: recordings do not mark them.
-- Source: the traffic light violation of the Waymo Open Sim Agents metrics (2025): crossing the stop point of the
-- lane while its light is STOP or ARROW_STOP.
-- min_speed = 1.0
-- min_red = 0.0
-- ego_only = false
WITH crossings AS (
    SELECT r.*, b.timestep AS earlier_timestep
    FROM at_red AS r JOIN at_red AS b USING (scenario_id, track_id, light_id, lane_id)
    WHERE
        b.timestep = r.timestep - 1 AND r.before < 0 AND b.before >= 0 AND r.speed > $min_speed
        AND (r.track_id = r.ego_id OR NOT $ego_only)
),
reds AS (
    SELECT
        c.*,
        len(list_filter(m.timestamps, lambda t: t <= c.seconds - $min_red + 1e-6)) AS first,  -- recorded times, not dt
        s.state[greatest(first, 1) : c.timestep + 1] AS since
    FROM crossings AS c
    JOIN stop_lines AS s USING (scenario_id, light_id, lane_id)
    JOIN metadata AS m USING (scenario_id)
)
SELECT
    scenario_id,
    track_id,
    NULL::VARCHAR AS other_id,
    earlier_timestep AS first_timestep,
    timestep AS last_timestep,
    max(speed) AS value
FROM reds
WHERE len(list_filter(since, lambda state: state NOT IN ('LANE_STATE_STOP', 'LANE_STATE_ARROW_STOP', 'TRAFFIC_LIGHT_RED'))) = 0
GROUP BY scenario_id, track_id, earlier_timestep, timestep
