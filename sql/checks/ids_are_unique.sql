-- lake: Scenario ids are unique in the lake.
SELECT scenario_id, count(*) || ' rows of metadata' AS detail
FROM metadata_rows
GROUP BY scenario_id
HAVING count(*) > 1;
