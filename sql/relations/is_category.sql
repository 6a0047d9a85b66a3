-- An object is of a category: its type here (VEHICLE, PEDESTRIAN, CYCLIST ...), its type in the source, such as
-- BOX_TRUCK, in any case, or ANY.
-- category = "ANY"
SELECT scenario_id, track_id, timestep
FROM object_states
WHERE upper($category) = 'ANY' OR upper(object_type) = upper($category) OR upper(source_type) = upper($category)
