-- needs: maps
-- One row per link between lanes, as the source gives them: `relation` is SUCCESSOR, PREDECESSOR, LEFT or RIGHT.
-- `is_in_map` tells whether the other lane is in the map, too. metadata.map_id (with dataset and version) finds the
-- map.
CREATE VIEW lane_graph AS
WITH lanes AS (
    SELECT dataset, version, map_id, feature_id, entry_lanes, exit_lanes, left_neighbors, right_neighbors
    FROM maps
    WHERE starts_with(feature_type, 'LANE_')
),
links AS (
    SELECT dataset, version, map_id, feature_id AS lane_id, 'SUCCESSOR' AS relation, unnest(exit_lanes) AS other_lane_id
    FROM lanes
    UNION ALL
    SELECT dataset, version, map_id, feature_id, 'PREDECESSOR', unnest(entry_lanes) FROM lanes
    UNION ALL
    SELECT dataset, version, map_id, feature_id, 'LEFT', unnest(left_neighbors) FROM lanes
    UNION ALL
    SELECT dataset, version, map_id, feature_id, 'RIGHT', unnest(right_neighbors) FROM lanes
)
SELECT
    links.*,
    (dataset, version, map_id, other_lane_id) IN (SELECT (dataset, version, map_id, feature_id) FROM lanes) AS is_in_map
FROM links;
