-- An object's centre is in an area where vehicles may drive.
SELECT DISTINCT scenario_id, track_id, timestep
FROM source_places JOIN map_areas USING (dataset, version, map_id)
WHERE
    feature_type = 'DRIVABLE_AREA' AND px BETWEEN min_x AND max_x AND py BETWEEN min_y AND max_y
    AND in_outline(px, py, xs, ys)
