-- needs: motions, metadata_rows, outline_gaps
-- One row per object that was ever observed: its `timesteps` and its `steps` there, as lists by name, in the frame of
-- its map (see source_places), and the box around all its places, smoothed and recorded [m].
-- kept: relations read it again and again
CREATE VIEW walks AS
WITH placed AS (
    SELECT
        scenario_id, track_id, dataset, version, map_id, timestep AS timesteps,
        {
            'px': list_transform(x, lambda v: v + origin_x), 'py': list_transform(y, lambda v: v + origin_y),
            'yaw_rate': yaw_rate,
            'box_px': list_transform(box_x, lambda v: v + origin_x),
            'box_py': list_transform(box_y, lambda v: v + origin_y),
            'heading': heading, 'length': length, 'width': width
        } AS steps
    FROM motions JOIN metadata_rows USING (scenario_id)
    WHERE len(timestep) > 0
)
SELECT
    *,
    least(list_min(steps.px), list_min(steps.box_px)) AS "left",
    greatest(list_max(steps.px), list_max(steps.box_px)) AS "right",
    least(list_min(steps.py), list_min(steps.box_py)) AS low,
    greatest(list_max(steps.py), list_max(steps.box_py)) AS high,
    list_max(steps.length) AS length
FROM placed;
