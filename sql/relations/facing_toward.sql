-- The other is within $within_angle degrees of the direction in which an object points, and within $max_distance
-- metres from box to box.
-- within_angle = 22.5
-- max_distance = 50.0
SELECT scenario_id, track_id, other_id, timestep
FROM pairs
WHERE
    abs(degrees(atan2("left", ahead))) <= $within_angle
    AND distance <= $max_distance + sqrt(length ** 2 + width ** 2) / 2 + sqrt(other_length ** 2 + other_width ** 2) / 2
    AND box_gap(box_ahead, box_left, turn, length, width, other_length, other_width) <= $max_distance
