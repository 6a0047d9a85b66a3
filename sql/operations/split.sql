-- Each scenario's part: the first whose upper bound is greater than the scenario's value in [0, 1).
SELECT scenario_id, weight, content_hash, CASE {cases} END AS part
FROM (
{shares}
)
ORDER BY place
