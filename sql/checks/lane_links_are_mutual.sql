-- hard: Where a lane names a successor in the same map, that lane names it as a predecessor, and the other way round.
WITH lanes AS (
    SELECT map_id, feature_id, entry_lanes, exit_lanes FROM maps WHERE starts_with(feature_type, 'LANE_')
),
forward AS (
    SELECT * FROM (SELECT map_id, feature_id AS first, unnest(exit_lanes) AS second FROM lanes)
    WHERE (map_id, second) IN (SELECT (map_id, feature_id) FROM lanes)
),
backward AS (
    SELECT * FROM (SELECT map_id, unnest(entry_lanes) AS first, feature_id AS second FROM lanes)
    WHERE (map_id, first) IN (SELECT (map_id, feature_id) FROM lanes)
),
one_way AS (
    (FROM forward EXCEPT FROM backward) UNION ALL (FROM backward EXCEPT FROM forward)
),
broken AS (
    SELECT map_id, min(first || ' -> ' || second) AS example, count(*) AS n FROM one_way GROUP BY map_id
)
SELECT scenario_id, n || ' links are one-way, for example ' || example AS detail
FROM broken JOIN metadata_rows USING (map_id);
