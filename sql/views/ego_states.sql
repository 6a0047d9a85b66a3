-- needs: tracks, metadata_rows
-- One row per timestep at which the ego was observed; `seconds` is its time from the scenario's first timestep.
CREATE VIEW ego_states AS
WITH spans AS (
    -- Select the ego's row before expanding lists: it is one track in a hundred.
    SELECT
        scenario_id, track_id, start, x, y, z, heading, vx, vy, length, width, height, valid, timestamps, dt,
        unnest(range(len(vx))) + 1 AS i  -- lists are 1-based; most queries use the speed
    FROM tracks JOIN (SELECT scenario_id, ego_id AS track_id, timestamps, dt FROM metadata_rows)
        USING (scenario_id, track_id)
)
SELECT
    scenario_id,
    track_id,
    (start + i - 1)::INTEGER AS timestep,
    coalesce(timestamps[start + i], (start + i - 1) * dt) AS seconds,
    x[i] AS x,
    y[i] AS y,
    z[i] AS z,
    heading[i] AS heading,
    vx[i] AS vx,
    vy[i] AS vy,
    sqrt(vx[i] * vx[i] + vy[i] * vy[i]) AS speed,
    length[least(i, len(length))] AS length,
    width[least(i, len(width))] AS width,
    height[least(i, len(height))] AS height
FROM spans
WHERE valid IS NULL OR valid[i];
