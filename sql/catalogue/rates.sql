-- How often each disturbance happens: occurrences, and how far and long the egos drove, over all, by dataset, by place and
-- by road.
SELECT
    definition,
    coalesce(dataset, 'all') AS dataset,
    coalesce(place, 'all') AS place,
    coalesce(road, 'all') AS road,
    sum(coalesce(n, 0))::BIGINT AS occurrences,
    sum(meters) / 1000 AS km,
    sum(seconds) / 3600 AS hours
FROM (SELECT unnest($definitions) AS definition)
CROSS JOIN exposure
LEFT JOIN (
    SELECT definition, scenario_id, road, count(*) AS n FROM disturbances GROUP BY ALL
) USING (definition, scenario_id, road)
GROUP BY GROUPING SETS (
    (definition), (definition, dataset), (definition, dataset, place), (definition, dataset, place, road)
)
ORDER BY definition, dataset = 'all' DESC, dataset, place = 'all' DESC, place, road = 'all' DESC, road
