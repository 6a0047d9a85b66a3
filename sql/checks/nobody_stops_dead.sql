-- hard: No object has a velocity of exactly 0 in its first or last state while it moves faster than 5 m/s there.
WITH ends AS (
    SELECT
        scenario_id,
        track_id,
        start + i AS t,
        start + j AS u,
        sqrt(vx[j] ** 2 + vy[j] ** 2) AS speed,
        sqrt((x[j] - x[i]) ** 2 + (y[j] - y[i]) ** 2) AS distance
    FROM (SELECT *, unnest([1, len(x)]) AS i, unnest([2, len(x) - 1]) AS j FROM tracks)  -- a state and its neighbour
    WHERE vx[i] = 0 AND vy[i] = 0 AND (valid IS NULL OR valid[j])
)
SELECT scenario_id, printf('track %s at timestep %d, at %.1f m/s one before or after', track_id, t - 1, speed) AS detail
FROM ends
JOIN metadata_rows USING (scenario_id)
WHERE speed > 5 AND distance > 5 * abs(coalesce(timestamps[u] - timestamps[t], dt));
