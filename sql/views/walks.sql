-- needs: motions, metadata_rows, outline_gaps
-- One row per object that was ever observed: its `timesteps`, and its `steps` there, as lists by name, with the origin of
-- their frame in that of its map (see source_places); the box around all its places, smoothed and recorded, in the
-- frame of its map; and its longest `length` [m].
CREATE VIEW walks AS
SELECT
    scenario_id, track_id, dataset, version, map_id, timestep AS timesteps,
    {
        'origin_x': origin_x, 'origin_y': origin_y, 'x': x, 'y': y, 'yaw_rate': yaw_rate,
        'box_x': box_x, 'box_y': box_y, 'heading': heading, 'length': length, 'width': width
    } AS steps,
    m.min_x + origin_x AS "left", m.max_x + origin_x AS "right", m.min_y + origin_y AS low, m.max_y + origin_y AS high,
    longest AS length
FROM motions AS m JOIN metadata_rows USING (scenario_id)
WHERE len(timestep) > 0;
