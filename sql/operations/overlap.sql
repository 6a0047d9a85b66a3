-- Overlap of two databases, where ({keyed}) gives every member a key: the number of members of each, and examples.
WITH keyed AS MATERIALIZED (
{keyed}
),
shared AS MATERIALIZED (
    SELECT
        key,
        min(scenario_id) FILTER (parent = 0) AS first_id,
        min(scenario_id) FILTER (parent = 1) AS second_id
    FROM keyed
    GROUP BY key
    HAVING min(parent) <> max(parent)
)
SELECT
    count(DISTINCT scenario_id) FILTER (parent = 0) AS num_first,
    count(DISTINCT scenario_id) FILTER (parent = 1) AS num_second,
    (SELECT list(row) FROM (SELECT {'key': key, 'first': first_id, 'second': second_id} AS row FROM shared ORDER BY key LIMIT 5))
        AS examples
FROM keyed SEMI JOIN shared USING (key)
