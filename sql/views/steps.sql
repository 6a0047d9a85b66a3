-- needs: tracks, metadata_rows
-- One row per object and pair of successive timesteps at which it was observed: its motion between them.
-- `timestep` is the second of the two; `is_inner` is false for the first and last pair of a run of timesteps.
CREATE VIEW steps AS
WITH spans AS (
    SELECT tracks.*, timestamps, dt, unnest(range(1, len(x))) AS i  -- lists are 1-based
    FROM tracks JOIN metadata_rows USING (scenario_id)
)
SELECT
    scenario_id,
    track_id,
    object_type,
    (start + i)::INTEGER AS timestep,
    coalesce(timestamps[start + i + 1] - timestamps[start + i], dt) AS seconds,
    x[i + 1] - x[i] AS dx,
    y[i + 1] - y[i] AS dy,
    (vx[i] + vx[i + 1]) / 2 AS vx,
    (vy[i] + vy[i + 1]) / 2 AS vy,
    i > 1 AND i + 1 < len(x) AND (valid IS NULL OR (valid[i - 1] AND valid[i + 2])) AS is_inner,
    is_velocity_estimated
FROM spans
WHERE valid IS NULL OR (valid[i] AND valid[i + 1]);
