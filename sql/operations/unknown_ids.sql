-- Elements of $ids that are neither the id of a scenario of the pool nor its id in the source.
SELECT id
FROM (SELECT DISTINCT unnest($ids::VARCHAR[]) AS id)
WHERE id NOT IN (SELECT scenario_id FROM {pool}) AND id NOT IN (SELECT source_scenario_id FROM {pool})
ORDER BY id
