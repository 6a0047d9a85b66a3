-- needs: lane_outlines, lane_continuations
-- One row per lane and lane of the same road: on the same side, that is on lanes that continue it or lie beside
-- these and lead the same way; or on the opposite side (`is_opposite`), beside one of these but leading the other
-- way.
-- kept: relations read it again and again
CREATE VIEW road_sides AS
WITH RECURSIVE beside AS MATERIALIZED (
    SELECT DISTINCT
        l.dataset, l.version, l.map_id, l.lane_id, other_lane_id,
        cos(l.lane_heading - o.lane_heading) < 0 AS is_opposite
    FROM (
        SELECT *, unnest(list_concat(left_neighbors, right_neighbors)) AS other_lane_id FROM lane_outlines
    ) AS l
    JOIN lane_outlines AS o
        ON o.dataset = l.dataset AND o.version = l.version AND o.map_id = l.map_id AND o.lane_id = other_lane_id
),
same AS (
    SELECT dataset, version, map_id, lane_id, other_lane_id FROM lane_continuations
    UNION
    SELECT s.dataset, s.version, s.map_id, s.lane_id, b.other_lane_id
    FROM same AS s JOIN beside AS b ON
        b.dataset = s.dataset AND b.version = s.version AND b.map_id = s.map_id AND b.lane_id = s.other_lane_id
        AND NOT b.is_opposite
),
opposite AS (
    SELECT DISTINCT s.dataset, s.version, s.map_id, s.lane_id, b.other_lane_id
    FROM same AS s JOIN beside AS b ON
        b.dataset = s.dataset AND b.version = s.version AND b.map_id = s.map_id AND b.lane_id = s.other_lane_id
        AND b.is_opposite
)
SELECT *, false AS is_opposite FROM same
UNION ALL
SELECT DISTINCT o.dataset, o.version, o.map_id, o.lane_id, s.other_lane_id, true
FROM opposite AS o JOIN same AS s ON
    s.dataset = o.dataset AND s.version = o.version AND s.map_id = o.map_id AND s.lane_id = o.other_lane_id;
