-- An object is on a lane for vehicles of all kinds (VEHICLE), on a bicycle lane (BIKE), or on one of another type of
-- the source, such as BUS.
-- lane_type = "VEHICLE"
SELECT scenario_id, track_id, timestep
FROM object_lanes
WHERE lane_type = upper($lane_type)
