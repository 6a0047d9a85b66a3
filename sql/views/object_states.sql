-- needs: tracks
-- One row per object and timestep at which it was observed (the long form of tracks).
CREATE VIEW object_states AS
WITH spans AS (
    SELECT *, unnest(range(len(x))) + 1 AS i  -- lists are 1-based
    FROM tracks
)
SELECT
    scenario_id,
    track_id,
    object_type,
    source_type,
    (start + i - 1)::INTEGER AS timestep,
    x[i] AS x,
    y[i] AS y,
    z[i] AS z,
    heading[i] AS heading,
    vx[i] AS vx,
    vy[i] AS vy,
    sqrt(vx[i] * vx[i] + vy[i] * vy[i]) AS speed,
    length[least(i, len(length))] AS length,
    width[least(i, len(width))] AS width,
    height[least(i, len(height))] AS height,
    coalesce(is_interpolated[i], false) AS is_interpolated
FROM spans
WHERE valid IS NULL OR valid[i];
