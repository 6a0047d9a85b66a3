-- An object's centre is on a lane that is in an intersection, or within $threshold metres of it.
-- threshold = 5.0
SELECT DISTINCT scenario_id, track_id, timestep
FROM source_places JOIN lane_outlines USING (dataset, version, map_id)
WHERE
    is_intersection
    AND px BETWEEN min_x - $threshold AND max_x + $threshold AND py BETWEEN min_y - $threshold AND max_y + $threshold
    AND outline_gap(px, py, xs, ys) <= $threshold
