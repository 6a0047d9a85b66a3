-- New cells per 1,000 scenarios, by tenths of the scenarios in a fixed random order (by the hash of their ids).
WITH ordered AS (
    SELECT scenario_id, row_number() OVER (ORDER BY md5(scenario_id)) - 1 AS place, count(*) OVER () AS total
    FROM (SELECT DISTINCT scenario_id FROM exposure)
),
tenths AS (SELECT *, 1 + (10 * place // total) AS tenth FROM ordered),
firsts AS (
    SELECT definition, cell, min(place) AS place
    FROM disturbances JOIN ordered USING (scenario_id)
    GROUP BY ALL
)
SELECT
    definition, tenth, any_value(scenarios) AS scenarios, count(f.cell) AS new_cells,
    1000 * count(f.cell) / any_value(scenarios) AS new_per_1000
FROM (SELECT unnest($definitions) AS definition)
CROSS JOIN (SELECT tenth, count(*) AS scenarios FROM tenths GROUP BY tenth)
LEFT JOIN (SELECT definition, cell, tenth FROM firsts JOIN tenths USING (place)) AS f USING (definition, tenth)
GROUP BY definition, tenth
ORDER BY definition, tenth
