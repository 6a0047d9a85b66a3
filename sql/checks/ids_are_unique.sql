-- lake: No two scenarios of a lake have the same id.
SELECT scenario_id, count(*) || ' rows of metadata' AS detail
FROM metadata_rows
GROUP BY scenario_id
HAVING count(*) > 1;
