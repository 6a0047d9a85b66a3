-- The vehicle ahead of the ego on its path slows down by $min m/s^2 or more, over one second: from the first such second
-- to the last. Parameters: `ego_speed`, `speed` [m/s] and `gap` [m] from bumper to bumper, means over the second that
-- ends half a second before it begins; `rate` [m/s^2], its strongest deceleration over one second. The gap is at most
-- $max_gap, the ego faster than $min_speed.
-- Source: UN Regulation 157, annex 4, appendix 3: deceleration with Ve0, Vo0, dx0 and Gx_max. ISO 34502: traffic
-- disturbance, deceleration. The threshold, seconds and limits are our reading; dG/dt, how fast the deceleration grows, is
-- left out, because recordings at 10 Hz do not show it.
-- min = 2.0
-- max_gap = 60.0
-- min_speed = 2.0
WITH slowing AS (
    SELECT r.*, r.timestep - row_number() OVER (PARTITION BY r.scenario_id, r.track_id ORDER BY r.timestep) AS run
    FROM corridor_rates AS r JOIN ego_leads AS l USING (scenario_id, track_id, timestep)
    WHERE r.acceleration <= -$min
)
SELECT
    scenario_id, track_id, any_value(ego_id) AS other_id,
    min(timestep) AS first_timestep, max(timestep) AS last_timestep, max(-acceleration) AS value,
    arg_min(ego_speed_before, timestep) AS ego_speed, arg_min(speed_before, timestep) AS speed,
    arg_min(gap_before, timestep) AS gap, max(-acceleration) AS rate
FROM slowing
GROUP BY scenario_id, track_id, run
HAVING gap BETWEEN 0 AND $max_gap AND arg_min(ego_speed_before, timestep) > $min_speed
