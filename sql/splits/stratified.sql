-- A value in [0, 1) for each scenario, spread evenly over the groups of each stratum in the order of a hash: every
-- part gets its fraction of every stratum, within one group. The offset of each stratum is random, too; otherwise all
-- small strata would fall into the same part. A group in several strata belongs to the first.
WITH groups AS (
    SELECT kin, min("{stratify}")::VARCHAR AS stratum, {drawn_kin} AS luck
    FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS kin FROM {pool})
    GROUP BY kin
),
shares AS (
    SELECT
        kin,
        (row_number() OVER (PARTITION BY stratum ORDER BY luck, kin) - 1 + {drawn_stratum})
        / count(*) OVER (PARTITION BY stratum) AS share
    FROM groups
)
SELECT scenario_id, weight, content_hash, place, share
FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS kin FROM {pool})
JOIN shares USING (kin)
