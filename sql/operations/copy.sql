-- All members of the database.
SELECT scenario_id, weight, content_hash
FROM members
ORDER BY position
