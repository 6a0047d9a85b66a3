-- The members of the parent as this snapshot has them; who is gone is left out.
SELECT scenario_id, weight, content_hash
FROM {pool}
ORDER BY place
