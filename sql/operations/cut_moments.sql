-- The scenarios that were cut out of kept moments, in their order.
SELECT made.scenario_id, 1.0::DOUBLE AS weight, made.content_hash
FROM (
    {wanted}
) AS wanted
JOIN metadata AS made ON made.scenario_id = made_id
ORDER BY rank
