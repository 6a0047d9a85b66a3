-- hard: If a lane has a successor in the same map, that lane has it as a predecessor, and vice versa.
WITH links AS (
    SELECT dataset, version, map_id, feature_id AS first, unnest(exit_lanes) AS second, 1 AS side FROM lanes
    UNION ALL
    SELECT dataset, version, map_id, unnest(entry_lanes), feature_id, 2 FROM lanes
),
one_way AS (
    SELECT dataset, version, map_id, first, second
    FROM links
    GROUP BY ALL
    HAVING min(side) = max(side)
)
-- Both lanes must be in the map, and in the scenario's window on a shared map.
SELECT
    scenario_id,
    if(scenario_id IS NULL, concat_ws('/', 'map ' || dataset, version, map_id) || ': ', '')
    || count(*) || ' links are one-way, for example ' || min(first || ' -> ' || second) AS detail
FROM one_way
JOIN lanes AS a USING (dataset, version, map_id)
JOIN lanes AS b USING (dataset, version, map_id)
JOIN map_windows AS w USING (dataset, version, map_id)
WHERE
    a.feature_id = first
    AND b.feature_id = second
    AND (
        w.is_whole
        OR (
            greatest(a.min_x, b.min_x) <= w.max_x AND least(a.max_x, b.max_x) >= w.min_x
            AND greatest(a.min_y, b.min_y) <= w.max_y AND least(a.max_y, b.max_y) >= w.min_y
        )
    )
GROUP BY scenario_id, dataset, version, map_id;
