-- Scenarios that satisfy every condition, in the order of the database unless another is asked for.
SELECT scenario_id, weight, content_hash
FROM {pool} AS metadata
WHERE {conditions}
ORDER BY {ranking}
