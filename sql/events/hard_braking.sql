-- A vehicle or cyclist decelerates by at least $min m/s^2, averaged over half a second; ego_only=true considers only
-- the ego. Lasts from the start of the first half second to the end of the last; value is the peak deceleration, in
-- m/s^2.
-- Source: 4.05 m/s^2 is the bound of comfortable braking in nuPlan's closed-loop metric ego_is_comfortable.
-- min = 4.05
-- ego_only = false
WITH hard AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM motion
    WHERE object_type IN ('VEHICLE', 'CYCLIST') AND (is_ego OR NOT $ego_only) AND acceleration <= -$min
)
SELECT
    scenario_id,
    track_id,
    NULL::VARCHAR AS other_id,
    (min(timestep) - any_value(num_steps))::INTEGER AS first_timestep,
    max(timestep) AS last_timestep,
    max(-acceleration) AS value
FROM hard
GROUP BY scenario_id, track_id, run
