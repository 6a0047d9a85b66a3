-- An object and the other are on the same lane, or on lanes that continue each other (view lane_continuations).
SELECT t.scenario_id, t.track_id, o.track_id AS other_id, t.timestep
FROM object_lanes AS t
JOIN lane_continuations AS l USING (dataset, version, map_id, lane_id)
JOIN object_lanes AS o ON
    o.scenario_id = t.scenario_id AND o.timestep = t.timestep
    AND o.lane_id = l.other_lane_id AND o.track_id <> t.track_id
