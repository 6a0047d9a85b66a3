-- Scenarios that satisfy every condition, in the order of the database.
SELECT scenario_id, weight, content_hash
FROM {pool} AS metadata
WHERE {conditions}
ORDER BY place
