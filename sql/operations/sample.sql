-- The $n scenarios (or the $fraction of all) that are first by `turn`, in the order of the database.
SELECT scenario_id, weight, content_hash
FROM (
    SELECT *, row_number() OVER (ORDER BY turn, luck, scenario_id) AS rank, count(*) OVER () AS total
    FROM (
{turns}
    )
)
WHERE rank <= coalesce($n::BIGINT, round($fraction::DOUBLE * total))
ORDER BY place
