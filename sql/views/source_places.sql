-- needs: smoothed, metadata_rows
-- One row per object and timestep at which it was observed, in the frame of its map, which a shared map and all its
-- scenarios have in common: `px`, `py` is the smoothed centre of its box, `box_px`, `box_py` the recorded one [m].
CREATE VIEW source_places AS
SELECT
    scenario_id, track_id, timestep, yaw_rate, heading, length, width, dataset, version, map_id,
    x + origin_x AS px, y + origin_y AS py, box_x + origin_x AS box_px, box_y + origin_y AS box_py
FROM smoothed JOIN metadata_rows USING (scenario_id);
