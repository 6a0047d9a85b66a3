-- soft: A lane ends where its successors begin, within the dataset's budget for the gap.
WITH links AS (
    SELECT *, unnest(exit_lanes) AS successor FROM lanes JOIN budgets USING (dataset)
),
seen AS (
    SELECT
        w.scenario_id,
        w.dataset,
        w.version,
        w.map_id,
        a.feature_id || ' -> ' || b.feature_id AS link,
        sqrt((a.end_x - b.start_x) ** 2 + (a.end_y - b.start_y) ** 2) AS gap
    FROM links AS a
    JOIN lanes AS b
        ON b.dataset = a.dataset AND b.version = a.version AND b.map_id = a.map_id AND b.feature_id = a.successor
    JOIN map_windows AS w ON w.dataset = a.dataset AND w.version = a.version AND w.map_id = a.map_id
    WHERE
        gap > a.link_gap
        AND (
            w.is_whole
            OR (
                greatest(a.min_x, b.min_x) <= w.max_x AND least(a.max_x, b.max_x) >= w.min_x
                AND greatest(a.min_y, b.min_y) <= w.max_y AND least(a.max_y, b.max_y) >= w.min_y
            )
        )
)
SELECT
    scenario_id,
    if(scenario_id IS NULL, concat_ws('/', 'map ' || dataset, version, map_id) || ': ', '')
    || printf('%d links jump, the widest %s by %.1f m', count(*), arg_max(link, gap), max(gap)) AS detail
FROM seen
GROUP BY scenario_id, dataset, version, map_id;
