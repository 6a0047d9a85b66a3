-- Scenarios with at least $min and at most $max objects of a $type: vehicle (the ego included), pedestrian, cyclist,
-- cone, barrier or other.
-- type = "pedestrian"
-- min = 1
-- max = 1000000000
CASE lower($type)
    WHEN 'vehicle' THEN num_vehicles
    WHEN 'pedestrian' THEN num_pedestrians
    WHEN 'cyclist' THEN num_cyclists
    WHEN 'cone' THEN num_cones
    WHEN 'barrier' THEN num_barriers
    WHEN 'other' THEN num_others
    ELSE error('object_type: wanted vehicle, pedestrian, cyclist, cone, barrier or other, found ' || $type)
END BETWEEN $min AND $max
