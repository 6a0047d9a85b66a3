-- At least $min_number others are in a direction of an object (forward, backward, left, right): beyond that side of its
-- box, at most $lateral_thresh metres outside of it along the other axis, and within $within_distance metres from box
-- to box. Of more than $max_number, the nearest count.
-- direction = "forward"
-- min_number = 1
-- max_number = 1000000
-- within_distance = 50.0
-- lateral_thresh = Infinity
WITH beside AS MATERIALIZED (
    SELECT
        scenario_id, track_id, other_id, timestep,
        box_gap(box_ahead, box_left, turn, length, width, other_length, other_width) AS gap
    FROM pairs  -- each object, each pair if min_number = 1, max_number = 1000000
    WHERE
        distance <= $within_distance + radius + other_radius
        AND CASE $direction
            WHEN 'forward' THEN ahead > length / 2 AND abs("left") < width / 2 + $lateral_thresh
            WHEN 'backward' THEN ahead < -length / 2 AND abs("left") < width / 2 + $lateral_thresh
            WHEN 'left' THEN "left" > width / 2 AND abs(ahead) < length / 2 + $lateral_thresh
            WHEN 'right' THEN "left" < -width / 2 AND abs(ahead) < length / 2 + $lateral_thresh
            ELSE error('direction: wanted forward, backward, left or right, found ' || $direction)
        END
),
nearest AS (
    SELECT *
    FROM beside
    WHERE gap <= $within_distance
    QUALIFY row_number() OVER (PARTITION BY scenario_id, track_id, timestep ORDER BY gap, other_id) <= $max_number
)
SELECT scenario_id, track_id, other_id, timestep
FROM nearest
QUALIFY count(*) OVER (PARTITION BY scenario_id, track_id, timestep) >= $min_number
