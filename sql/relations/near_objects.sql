-- At least $min_objects other objects are within $distance_thresh metres of an object, from box to box; each of them is
-- an other.
-- distance_thresh = 10.0
-- min_objects = 1
WITH near AS MATERIALIZED (
    SELECT scenario_id, track_id, other_id, timestep, box_gap(box_ahead, box_left, turn, length, width, other_length, other_width) AS gap
    FROM pairs  -- each object, each pair if min_objects = 1
    WHERE distance <= $distance_thresh + radius + other_radius
)
SELECT scenario_id, track_id, other_id, timestep
FROM near
WHERE gap <= $distance_thresh
QUALIFY count(*) OVER (PARTITION BY scenario_id, track_id, timestep) >= $min_objects
