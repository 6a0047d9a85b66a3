-- hard: Where a lane names a successor in the same map, that lane names it as a predecessor, and the other way round.
WITH forward AS (
    SELECT dataset, version, map_id, feature_id AS first, unnest(exit_lanes) AS second FROM lanes
),
backward AS (
    SELECT dataset, version, map_id, unnest(entry_lanes) AS first, feature_id AS second FROM lanes
),
one_way AS (
    (FROM forward EXCEPT FROM backward) UNION ALL (FROM backward EXCEPT FROM forward)
),
seen AS (
    -- Both lanes have to be in the map, and in the window that a scenario has on a shared one.
    SELECT w.scenario_id, w.dataset, w.version, w.map_id, first || ' -> ' || second AS link
    FROM one_way AS o
    JOIN lanes AS a ON a.dataset = o.dataset AND a.version = o.version AND a.map_id = o.map_id AND a.feature_id = first
    JOIN lanes AS b ON b.dataset = o.dataset AND b.version = o.version AND b.map_id = o.map_id AND b.feature_id = second
    JOIN map_windows AS w ON w.dataset = o.dataset AND w.version = o.version AND w.map_id = o.map_id
    WHERE
        w.is_whole
        OR (
            greatest(a.min_x, b.min_x) <= w.max_x AND least(a.max_x, b.max_x) >= w.min_x
            AND greatest(a.min_y, b.min_y) <= w.max_y AND least(a.max_y, b.max_y) >= w.min_y
        )
)
SELECT
    scenario_id,
    if(scenario_id IS NULL, concat_ws('/', 'map ' || dataset, version, map_id) || ': ', '')
    || count(*) || ' links are one-way, for example ' || min(link) AS detail
FROM seen
GROUP BY scenario_id, dataset, version, map_id;
