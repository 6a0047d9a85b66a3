-- An object follows the other: they move in about the same direction (60 degrees), the other is in front of it by at
-- most 25 m from its box, on the same lane or the next one and within 5 m aside, or on the lane beside and partly in
-- front of its box.
WITH courses AS (
    SELECT
        * REPLACE (
            CASE WHEN speed > 0.5 THEN course ELSE heading END AS course,
            CASE WHEN other_speed > 0.5 THEN other_course ELSE other_heading END AS other_course
        )
    FROM pairs  -- each pair
    WHERE distance < 60 AND ahead > length / 2 AND ahead < 25 + length / 2 AND abs("left") < 15
)
SELECT DISTINCT p.scenario_id, p.track_id, p.other_id, p.timestep
FROM courses AS p
JOIN object_lanes AS t USING (scenario_id, track_id, timestep)
JOIN object_lanes AS o ON o.scenario_id = p.scenario_id AND o.track_id = p.other_id AND o.timestep = p.timestep
JOIN lane_outlines AS l ON
    l.dataset = t.dataset AND l.version = t.version AND l.map_id = t.map_id AND l.lane_id = t.lane_id
WHERE
    cos(course - other_course) > 0.5
    AND (
        (o.lane_id = t.lane_id OR list_contains(exit_lanes, o.lane_id)) AND abs("left") < 5
        OR (list_contains(left_neighbors, o.lane_id) OR list_contains(right_neighbors, o.lane_id))
            AND least(abs("left" + other_width / 2), abs("left" - other_width / 2)) <= width / 2
    )
