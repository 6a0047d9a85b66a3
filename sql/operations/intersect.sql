-- Members of the first parent that are members of every other one too, in its order.
SELECT scenario_id, weight, content_hash
FROM members
WHERE parent = 0 AND scenario_id IN (
    SELECT scenario_id FROM members WHERE parent > 0 GROUP BY scenario_id HAVING count(*) = {last}
)
ORDER BY position
