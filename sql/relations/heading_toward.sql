-- An object moves within $angle_threshold degrees of the direction to the other, which comes nearer at $minimum_speed m/s
-- or more, and is within $max_distance metres from box to box.
-- angle_threshold = 22.5
-- minimum_speed = 0.5
-- max_distance = Infinity
WITH approaches AS (
    SELECT
        *,
        vx * heading_x + vy * heading_y AS v_ahead,
        vy * heading_x - vx * heading_y AS v_left,
        (other_vx - vx) * heading_x + (other_vy - vy) * heading_y AS closing_ahead,
        (other_vy - vy) * heading_x - (other_vx - vx) * heading_y AS closing_left
    FROM pairs  -- each pair
    WHERE distance <= $max_distance + radius + other_radius
),
toward AS MATERIALIZED (
    SELECT
        scenario_id, track_id, other_id, timestep,
        box_gap(box_ahead, box_left, turn, length, width, other_length, other_width) AS gap
    FROM approaches
    WHERE
        -(closing_ahead * ahead + closing_left * "left") / nullif(sqrt(ahead * ahead + "left" * "left"), 0)
            >= $minimum_speed
        AND abs(degrees(wrap_angle(atan2(v_left, v_ahead) - atan2("left", ahead)))) <= $angle_threshold
)
SELECT scenario_id, track_id, other_id, timestep
FROM toward
WHERE gap <= $max_distance
