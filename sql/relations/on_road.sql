-- An object is on a lane, be it for vehicles, buses or bicycles.
SELECT scenario_id, track_id, timestep
FROM object_lanes
