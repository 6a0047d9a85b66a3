-- The members of the parent as this snapshot has them; missing ones are left out.
SELECT scenario_id, weight, content_hash
FROM {pool}
ORDER BY place
