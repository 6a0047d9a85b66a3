-- needs: lane_outlines
-- One row per lane and lane that drivers would call the same one: itself, and the lanes before and after it that
-- lead straight on. From each lane it is the straightest of those that are outside of intersections, or cross one
-- without turning; a lane that turns in an intersection has no others.
-- kept: relations read it again and again
CREATE VIEW lane_continuations AS
WITH RECURSIVE lanes AS MATERIALIZED (
    SELECT
        dataset, version, map_id, lane_id, lane_heading, entry_lanes, exit_lanes,
        coalesce(is_intersection, false) AND turns <> 0 AS is_turn
    FROM lane_outlines
),
links AS (
    SELECT *, unnest(exit_lanes) AS other_lane_id, 1 AS way FROM lanes
    UNION ALL
    SELECT *, unnest(entry_lanes), -1 FROM lanes
),
straightest AS (
    SELECT l.dataset, l.version, l.map_id, l.lane_id, way, other_lane_id
    FROM links AS l JOIN lanes AS o
        ON o.dataset = l.dataset AND o.version = l.version AND o.map_id = l.map_id AND o.lane_id = other_lane_id
    WHERE NOT o.is_turn AND (way = 1 OR cos(o.lane_heading - l.lane_heading) > 0)
    QUALIFY row_number() OVER (
        PARTITION BY l.dataset, l.version, l.map_id, l.lane_id, way
        ORDER BY cos(o.lane_heading - l.lane_heading) DESC, other_lane_id
    ) = 1
),
chains AS (
    SELECT dataset, version, map_id, lane_id, lane_id AS other_lane_id, unnest([1, -1]) AS way
    FROM lanes
    WHERE NOT is_turn
    UNION
    SELECT c.dataset, c.version, c.map_id, c.lane_id, s.other_lane_id, c.way
    FROM chains AS c JOIN straightest AS s ON
        s.dataset = c.dataset AND s.version = c.version AND s.map_id = c.map_id
        AND s.lane_id = c.other_lane_id AND s.way = c.way
)
SELECT DISTINCT dataset, version, map_id, lane_id, other_lane_id FROM chains
UNION ALL
SELECT dataset, version, map_id, lane_id, lane_id FROM lanes WHERE is_turn;
