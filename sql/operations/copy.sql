-- All members of the parent.
SELECT scenario_id, weight, content_hash
FROM members
ORDER BY position
