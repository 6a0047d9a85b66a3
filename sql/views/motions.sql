-- needs: tracks, metadata_rows, track_motion
-- One row per object, with lists over the timesteps at which it was observed: the columns of `smoothed`, which has a row
-- for each of their elements; `extent` [m], the diagonal of the box around all its positions, `min_x`, `max_x`, `min_y` and
-- `max_y` of these and of the recorded ones, and its `longest` length [m].
-- kept: relations read it again and again
CREATE VIEW motions AS
WITH found AS (
    SELECT
        scenario_id, track_id, object_type, source_type,
        track_motion(
            {'x': x, 'y': y, 'z': z, 'heading': heading, 'length': length, 'width': width},
            valid, start, timestamps, dt
        ) AS motion
    FROM tracks JOIN (SELECT scenario_id, timestamps, dt FROM metadata_rows) USING (scenario_id)
)
SELECT scenario_id, track_id, object_type, source_type, unnest(motion) FROM found;
