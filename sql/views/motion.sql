-- needs: tracks, metadata_rows, wrap_angle
-- One row per object and timestep with its motion over the last half second (at least one timestep), because single
-- steps are noisy: `acceleration` [m/s^2] along its heading, `turned` [rad] and `yaw_rate` [rad/s], counter-clockwise.
-- `num_steps` and `seconds` are the length of that interval.
CREATE VIEW motion AS
WITH spans AS (
    SELECT
        scenario_id, track_id, object_type, track_id = ego_id AS is_ego,
        start, heading, vx, vy, valid, timestamps, dt, num_steps,
        unnest(range(num_steps + 1, len(x) + 1)) AS i  -- lists are 1-based
    FROM tracks JOIN (
        SELECT scenario_id, ego_id, timestamps, dt, greatest(round(0.5 / dt), 1)::INTEGER AS num_steps
        FROM metadata_rows
    ) USING (scenario_id)
),
ends AS (
    SELECT
        scenario_id, track_id, object_type, is_ego, (start + i - 1)::INTEGER AS timestep, num_steps,
        coalesce(timestamps[start + i] - timestamps[start + i - num_steps], num_steps * dt) AS seconds,
        vx[i] * cos(heading[i]) + vy[i] * sin(heading[i]) AS speed,
        vx[i - num_steps] * cos(heading[i - num_steps]) + vy[i - num_steps] * sin(heading[i - num_steps]) AS earlier_speed,
        wrap_angle(heading[i] - heading[i - num_steps]) AS turned
    FROM spans
    WHERE valid IS NULL OR (valid[i] AND valid[i - num_steps])
)
SELECT
    * EXCLUDE (earlier_speed),
    (speed - earlier_speed) / seconds AS acceleration,
    turned / seconds AS yaw_rate
FROM ends;
