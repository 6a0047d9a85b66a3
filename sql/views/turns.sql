-- needs: motion
-- One row per turn of a vehicle or cyclist by more than 30 degrees: while it moves faster than 0.5 m/s it turns to one
-- side by more than 0.08 rad/s; stopping in between does not end the turn. `angle` [rad] is positive to the left.
-- kept: relations and events read it again and again
CREATE VIEW turns AS
WITH moving AS (
    SELECT
        *,
        CASE WHEN abs(yaw_rate) > 0.08 THEN sign(yaw_rate) ELSE 0 END AS side,
        row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS place
    FROM motion
    WHERE object_type IN ('VEHICLE', 'CYCLIST') AND abs(speed) > 0.5
),
runs AS (
    SELECT
        *,
        place - row_number() OVER (PARTITION BY scenario_id, track_id, side ORDER BY timestep) AS run
    FROM moving
    WHERE side <> 0
)
SELECT
    scenario_id,
    track_id,
    object_type,
    is_ego,
    (min(timestep) - any_value(num_steps))::INTEGER AS first_timestep,
    max(timestep) AS last_timestep,
    sum(turned / num_steps) AS angle  -- each change of heading is part of num_steps rows
FROM runs
GROUP BY scenario_id, track_id, object_type, is_ego, side, run
HAVING abs(angle) > pi() / 6;
