-- What conversions dropped or assumed: each kind of defect with its count and one example. $dataset is a LIKE pattern.
-- dataset = "%"
SELECT
    dataset,
    version,
    split,
    "table",
    action,
    field,
    regexp_replace(reason, ', found .*', '') AS expected,
    sum(count)::BIGINT AS rows,
    count(DISTINCT coalesce(scenario_id, map_id)) AS scenarios,
    arg_min(file || ', ' || location || ': ' || reason, (shard, scenario_id)) AS example
FROM defects
WHERE dataset LIKE $dataset
GROUP BY ALL
ORDER BY rows DESC, dataset, version, split, "table", action, field, expected;
