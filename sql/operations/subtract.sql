-- Members of the first database that are members of no other, in its order.
SELECT scenario_id, weight, content_hash
FROM members
WHERE parent = 0 AND scenario_id NOT IN (SELECT scenario_id FROM members WHERE parent > 0)
ORDER BY position
