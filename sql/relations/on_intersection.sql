-- An object is on a lane that is in an intersection.
SELECT scenario_id, track_id, timestep
FROM object_lanes
WHERE is_intersection
