-- hard: No object has a velocity of exactly 0 in its first or last state while it moves faster than 5 m/s there.
WITH stops AS (
    SELECT scenario_id, track_id, start, x, y, vx, vy, valid, len(x) AS n
    FROM tracks
    WHERE
        (vx[1] = 0 AND vy[1] = 0 AND vx[2] ** 2 + vy[2] ** 2 > 25)
        OR (vx[-1] = 0 AND vy[-1] = 0 AND vx[-2] ** 2 + vy[-2] ** 2 > 25)
),
ends AS (
    SELECT * EXCLUDE (n), unnest([1, n]) AS i, unnest([2, n - 1]) AS j  -- the state and its neighbour
    FROM stops JOIN (SELECT scenario_id, timestamps, dt FROM metadata_rows) USING (scenario_id)
)
SELECT
    scenario_id,
    printf('track %s at timestep %d, at %.1f m/s one before or after', track_id, start + i - 1, sqrt(vx[j] ** 2 + vy[j] ** 2))
        AS detail
FROM ends
WHERE
    vx[i] = 0 AND vy[i] = 0
    AND (valid IS NULL OR valid[j])
    AND vx[j] ** 2 + vy[j] ** 2 > 25
    AND (x[j] - x[i]) ** 2 + (y[j] - y[i]) ** 2
        > 25 * coalesce(timestamps[start + j] - timestamps[start + i], dt * (j - i)) ** 2;
