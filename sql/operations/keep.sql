-- The members of the database that exist in this snapshot, with their present content.
SELECT scenario_id, weight, content_hash
FROM {pool}
ORDER BY place
