-- The vehicle behind the ego on its path speeds up by $min m/s^2 or more, over one second, and is faster than the ego:
-- from the first such second to the last. Parameters: `ego_speed`, `speed` [m/s] and `gap` [m] from bumper to bumper, means
-- over the second that ends half a second before it begins; `rate` [m/s^2], its strongest acceleration over one second.
-- The gap is at most $max_gap, the ego faster than $min_speed.
-- Source: ISO 34502: traffic disturbance, acceleration of a surrounding vehicle. That it is the one behind, the threshold,
-- seconds and limits are our reading.
-- min = 1.0
-- max_gap = 30.0
-- min_speed = 2.0
WITH behind AS (
    SELECT *
    FROM corridor_rates
    WHERE abs(aside) <= 1.5 AND ahead < 0
    QUALIFY row_number() OVER (PARTITION BY scenario_id, timestep ORDER BY ahead DESC, track_id) = 1
),
pressing AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM behind
    WHERE acceleration >= $min AND speed > ego_speed
)
SELECT
    scenario_id, track_id, any_value(ego_id) AS other_id,
    min(timestep) AS first_timestep, max(timestep) AS last_timestep, max(acceleration) AS value,
    arg_min(ego_speed_before, timestep) AS ego_speed, arg_min(speed_before, timestep) AS speed,
    arg_min(gap_before, timestep) AS gap, max(acceleration) AS rate
FROM pressing
GROUP BY scenario_id, track_id, run
HAVING gap BETWEEN 0 AND $max_gap AND arg_min(ego_speed_before, timestep) > $min_speed
