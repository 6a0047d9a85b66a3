-- At least $min_objects other objects are within $distance_thresh metres of an object, from box to box; each of them is
-- an other.
-- distance_thresh = 10.0
-- min_objects = 1
SELECT scenario_id, track_id, other_id, timestep
FROM pairs
WHERE
    distance <= $distance_thresh + sqrt(length ** 2 + width ** 2) / 2 + sqrt(other_length ** 2 + other_width ** 2) / 2
    AND box_gap(box_ahead, box_left, turn, length, width, other_length, other_width) <= $distance_thresh
QUALIFY count(*) OVER (PARTITION BY scenario_id, track_id, timestep) >= $min_objects
