-- The $n scenarios (or the $fraction of all) of the first rounds, in the order of the pool.
SELECT scenario_id, weight, content_hash
FROM (
    SELECT *, row_number() OVER (ORDER BY round, priority, scenario_id) AS rank, count(*) OVER () AS total
    FROM (
{rounds}
    )
)
WHERE rank <= coalesce($n::BIGINT, round($fraction::DOUBLE * total))
ORDER BY place
