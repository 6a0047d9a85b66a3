-- The ego changes to the lane beside it: it is on one lane for at least $min_hold seconds, then as long on another
-- that is a left or right neighbour of the first lane, of one of its successors, or of a predecessor.
-- Lasts from its last timestep on the first lane to its first on the other; value is 1 to the left, -1 to the right.
-- Maps without neighbours give no hits.
-- Source: the tag changing_lane of nuPlan, on the lanes of the map.
-- min_hold = 0.5
WITH runs AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, lane_id ORDER BY timestep) AS run FROM ego_lanes
),
stays AS (
    SELECT
        scenario_id, track_id, dataset, version, map_id, lane_id,
        min(timestep) AS first_timestep,
        max(timestep) AS last_timestep
    FROM runs
    GROUP BY ALL
    HAVING max(seconds) - min(seconds) >= $min_hold
),
changes AS (
    SELECT
        *,
        lead(lane_id) OVER later AS next_lane_id,
        lead(first_timestep) OVER later AS next_timestep
    FROM stays
    WINDOW later AS (PARTITION BY scenario_id ORDER BY first_timestep)
),
lanes AS (
    SELECT dataset, version, map_id, lane_id, left_neighbors, right_neighbors, list_concat(entry_lanes, exit_lanes) AS links
    FROM lane_outlines
),
beside AS (
    SELECT dataset, version, map_id, lane_id, unnest(left_neighbors) AS other_lane_id, 1 AS side FROM lanes
    UNION ALL
    SELECT dataset, version, map_id, lane_id, unnest(right_neighbors), -1 FROM lanes
),
links AS (
    SELECT dataset, version, map_id, lane_id, unnest(links) AS other_lane_id FROM lanes
),
reachable AS (
    SELECT * FROM beside
    UNION
    SELECT dataset, version, map_id, l.lane_id, b.other_lane_id, b.side
    FROM links AS l JOIN (SELECT * RENAME (lane_id AS middle) FROM beside) AS b USING (dataset, version, map_id)
    WHERE b.middle = l.other_lane_id
    UNION
    SELECT dataset, version, map_id, b.lane_id, l.other_lane_id, b.side
    FROM beside AS b JOIN (SELECT * RENAME (lane_id AS middle) FROM links) AS l USING (dataset, version, map_id)
    WHERE l.middle = b.other_lane_id
)
SELECT
    c.scenario_id,
    c.track_id,
    NULL::VARCHAR AS other_id,
    c.last_timestep AS first_timestep,
    c.next_timestep AS last_timestep,
    max(side)::DOUBLE AS value
FROM changes AS c JOIN reachable AS r
    ON r.dataset = c.dataset AND r.version = c.version AND r.map_id = c.map_id
    AND r.lane_id = c.lane_id AND r.other_lane_id = c.next_lane_id
WHERE (c.dataset, c.version, c.map_id, c.lane_id, c.next_lane_id) NOT IN (
    SELECT (dataset, version, map_id, lane_id, other_lane_id) FROM links
)
GROUP BY ALL
