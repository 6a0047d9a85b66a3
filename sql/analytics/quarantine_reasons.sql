-- Why scenarios were rejected: each kind of error with its count and one example. $dataset is a LIKE pattern.
-- dataset = "%"
SELECT
    dataset,
    version,
    split,
    error,
    field,
    count(*) AS scenarios,
    arg_min(message, (shard, position)) AS example
FROM quarantine
WHERE dataset LIKE $dataset
GROUP BY ALL
ORDER BY scenarios DESC, dataset, version, split, error, field;
