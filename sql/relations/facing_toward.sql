-- The other is within $within_angle degrees of the direction in which an object points, and within $max_distance
-- metres from box to box.
-- within_angle = 22.5
-- max_distance = 50.0
WITH ahead AS MATERIALIZED (
    SELECT scenario_id, track_id, other_id, timestep, box_gap(box_ahead, box_left, turn, length, width, other_length, other_width) AS gap
    FROM pairs  -- each pair
    WHERE distance <= $max_distance + radius + other_radius AND abs(atan2("left", ahead)) <= radians($within_angle)
)
SELECT scenario_id, track_id, other_id, timestep
FROM ahead
WHERE gap <= $max_distance
