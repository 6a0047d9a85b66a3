-- needs: motions
-- One row per object and timestep at which it was observed, with its motion from positions: `x`, `y`, `vx`, `vy`,
-- `accel_x` and `accel_y` [m/s^2] are medians of seven observations (0.6 s at 10 Hz); the derivatives are
-- differences of the neighbouring observations. `speed` [m/s] and `course` [rad] are those of the velocity. `yaw_rate`
-- [rad/s] is such a difference, not smoothed. `extent` [m] is the diagonal of the box around all its positions. The box
-- of the object is as recorded: `box_x`, `box_y`, heading (as a vector, `heading_x` and `heading_y`), length, width,
-- `radius` to its corners.
CREATE VIEW smoothed AS
SELECT
    scenario_id, track_id, object_type, source_type,
    unnest(timestep) AS timestep, unnest(seconds) AS seconds, unnest(x) AS x, unnest(y) AS y,
    unnest(vx) AS vx, unnest(vy) AS vy, unnest(accel_x) AS accel_x, unnest(accel_y) AS accel_y,
    unnest(yaw_rate) AS yaw_rate, unnest(speed) AS speed, unnest(course) AS course,
    unnest(box_x) AS box_x, unnest(box_y) AS box_y,
    unnest(heading) AS heading, unnest(heading_x) AS heading_x, unnest(heading_y) AS heading_y,
    unnest(length) AS length, unnest(width) AS width, unnest(radius) AS radius,
    extent
FROM motions;
