-- An object and the other are on the same side of the road, or on opposite sides ($side): on lanes that continue
-- each other or lie beside each other, and lead the same way; or on those beside these that lead the other way.
-- side = "same"
SELECT DISTINCT t.scenario_id, t.track_id, o.track_id AS other_id, t.timestep
FROM object_lanes AS t
JOIN road_sides AS r USING (dataset, version, map_id, lane_id)
JOIN object_lanes AS o ON
    o.scenario_id = t.scenario_id AND o.timestep = t.timestep
    AND o.lane_id = r.other_lane_id AND o.track_id <> t.track_id
WHERE CASE $side
    WHEN 'same' THEN NOT is_opposite
    WHEN 'opposite' THEN is_opposite
    ELSE error('side: wanted same or opposite, found ' || $side)
END
