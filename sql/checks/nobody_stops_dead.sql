-- hard: No object has a velocity of exactly 0 in its first or last state while it moves faster than 5 m/s there.
WITH ends AS (
    SELECT
        scenario_id, track_id, start, x, y, vx, vy, valid, timestamps, dt,
        unnest([{'i': 1, 'j': 2}, {'i': len(x), 'j': len(x) - 1}], recursive := true)  -- the state and its neighbour
    FROM tracks JOIN metadata_rows USING (scenario_id)
    WHERE len(x) > 1 AND ((vx[1] = 0 AND vy[1] = 0) OR (vx[len(x)] = 0 AND vy[len(x)] = 0))
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
