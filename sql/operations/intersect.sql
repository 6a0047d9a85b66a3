-- Members of the first database that are members of every other one, in its order.
SELECT scenario_id, weight, content_hash
FROM members
WHERE parent = 0 AND scenario_id IN (
    SELECT scenario_id FROM members WHERE parent > 0 GROUP BY scenario_id HAVING count(*) = {last}
)
ORDER BY position
