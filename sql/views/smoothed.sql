-- needs: tracks, metadata_rows, median_of_seven, central_rates, central_turn_rates
-- One row per object and timestep at which it was observed, with its motion from positions: `x`, `y`, `vx`, `vy`,
-- `accel_x` and `accel_y` [m/s^2] are medians of seven observations (0.6 s at 10 Hz); the derivatives are
-- differences of the neighbouring observations. `yaw_rate` [rad/s] is such a difference, not smoothed. `extent` [m]
-- is the diagonal of the box around all its positions. The box of the object is as recorded: `box_x`, `box_y`,
-- heading, length, width, `radius` to its corners.
-- kept: relations read it again and again
CREATE VIEW smoothed AS
WITH observed AS (
    -- Unobserved steps inside the span hold 0: omit them before measuring.
    SELECT
        *, list_filter(range(1, len(xs) + 1), lambda i: valid IS NULL OR valid[i]) AS seen
    FROM (
        SELECT
            scenario_id, track_id, object_type, source_type, start, valid,
            x AS xs, y AS ys, z AS zs, heading AS headings, length AS lengths, width AS widths, timestamps, dt
        FROM tracks JOIN (SELECT scenario_id, timestamps, dt FROM metadata_rows) USING (scenario_id)
    )
),
positions AS (
    SELECT
        * EXCLUDE (valid, xs, ys, zs, headings, timestamps),
        list_transform(seen, lambda i: coalesce(timestamps[start + i], (start + i - 1) * dt)) AS seconds,
        list_transform(seen, lambda i: xs[i]::DOUBLE) AS xs,
        list_transform(seen, lambda i: ys[i]::DOUBLE) AS ys,
        list_transform(seen, lambda i: coalesce(zs[i], 0)::DOUBLE) AS zs,
        list_transform(seen, lambda i: headings[i]::DOUBLE) AS headings
    FROM observed
),
velocities AS (
    SELECT
        *, central_rates(xs, seconds) AS vxs, central_rates(ys, seconds) AS vys,
        central_turn_rates(headings, seconds) AS yaw_rates
    FROM positions
),
accelerations AS (
    SELECT *, central_rates(vxs, seconds) AS axs, central_rates(vys, seconds) AS ays
    FROM velocities
),
numbered AS (
    -- By itself: lists that are computed beside unnest are computed again for every row.
    SELECT *, unnest(range(1, len(seen) + 1)) AS k FROM accelerations
),
steps AS (
    SELECT
        scenario_id,
        track_id,
        object_type,
        source_type,
        (start + seen[k] - 1)::INTEGER AS timestep,
        seconds[k] AS seconds,
        median_of_seven(xs, k) AS x,
        median_of_seven(ys, k) AS y,
        median_of_seven(zs, k) AS z,
        median_of_seven(vxs, k) AS vx,
        median_of_seven(vys, k) AS vy,
        median_of_seven(axs, k) AS accel_x,
        median_of_seven(ays, k) AS accel_y,
        yaw_rates[k] AS yaw_rate,
        xs[k] AS box_x,
        ys[k] AS box_y,
        headings[k] AS heading,
        lengths[least(seen[k], len(lengths))] AS length,
        widths[least(seen[k], len(widths))] AS width,
        sqrt(length::DOUBLE * length + width::DOUBLE * width) / 2 AS radius
    FROM numbered
)
SELECT
    * EXCLUDE (z),
    sqrt(
        (max(x) OVER track - min(x) OVER track) ** 2 + (max(y) OVER track - min(y) OVER track) ** 2
        + (max(z) OVER track - min(z) OVER track) ** 2
    ) AS extent
FROM steps
WINDOW track AS (PARTITION BY scenario_id, track_id);
