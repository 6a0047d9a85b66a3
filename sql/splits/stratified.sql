-- A share of [0, 1) for each scenario, spread evenly over the groups of each stratum, in the order of a hash: every
-- part gets its fraction of every stratum, plus or minus one group. The offset of a stratum is random, too, or
-- all small strata would fall into the same part. A group in several strata belongs to the first.
WITH groups AS (
    SELECT split_group, min("{stratify}")::VARCHAR AS stratum, {drawn_group} AS priority
    FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS split_group FROM {pool})
    GROUP BY split_group
),
shares AS (
    SELECT
        split_group,
        (row_number() OVER (PARTITION BY stratum ORDER BY priority, split_group) - 1 + {drawn_stratum})
        / count(*) OVER (PARTITION BY stratum) AS share
    FROM groups
)
SELECT scenario_id, weight, content_hash, place, share
FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS split_group FROM {pool})
JOIN shares USING (split_group)
