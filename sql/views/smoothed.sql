-- needs: tracks, metadata_rows, track_motion
-- One row per object and timestep at which it was observed, with its motion from positions: `x`, `y`, `vx`, `vy`,
-- `accel_x` and `accel_y` [m/s^2] are medians of seven observations (0.6 s at 10 Hz); the derivatives are
-- differences of the neighbouring observations. `speed` [m/s] and `course` [rad] are those of the velocity. `yaw_rate`
-- [rad/s] is such a difference, not smoothed. `extent` [m] is the diagonal of the box around all its positions. The box
-- of the object is as recorded: `box_x`, `box_y`, heading (as a vector, `heading_x` and `heading_y`), length, width,
-- `radius` to its corners.
-- kept: relations read it again and again
CREATE VIEW smoothed AS
WITH motions AS (
    SELECT
        scenario_id, track_id, object_type, source_type, start, length AS lengths, width AS widths,
        track_motion(x, y, z, heading, valid, start, timestamps, dt) AS motion
    FROM tracks JOIN (SELECT scenario_id, timestamps, dt FROM metadata_rows) USING (scenario_id)
),
steps AS (
    SELECT
        scenario_id, track_id, object_type, source_type, start, lengths, widths, motion.extent AS extent,
        unnest(motion.timestep) AS timestep, unnest(motion.seconds) AS seconds,
        unnest(motion.x) AS x, unnest(motion.y) AS y, unnest(motion.vx) AS vx, unnest(motion.vy) AS vy,
        unnest(motion.accel_x) AS accel_x, unnest(motion.accel_y) AS accel_y, unnest(motion.yaw_rate) AS yaw_rate,
        unnest(motion.box_x) AS box_x, unnest(motion.box_y) AS box_y, unnest(motion.heading) AS heading
    FROM motions
)
SELECT
    scenario_id, track_id, object_type, source_type, timestep, seconds, x, y, vx, vy, accel_x, accel_y, yaw_rate,
    sqrt(vx * vx + vy * vy) AS speed, atan2(vy, vx) AS course,
    box_x, box_y, heading, cos(heading) AS heading_x, sin(heading) AS heading_y,
    lengths[least(timestep - start + 1, len(lengths))]::DOUBLE AS length,
    widths[least(timestep - start + 1, len(widths))]::DOUBLE AS width,
    sqrt(length * length + width * width) / 2 AS radius,
    extent
FROM steps;
