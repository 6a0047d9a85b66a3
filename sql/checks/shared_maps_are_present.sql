-- lake: The shared map that a scenario refers to is in the lake.
SELECT scenario_id, 'map ' || map_id || ' is ' || coalesce(reason, 'not in the lake') AS detail
FROM metadata_rows
LEFT JOIN (SELECT dataset, version, name AS map_id, files[1] AS file FROM shards WHERE split = '')
    USING (dataset, version, map_id)
LEFT JOIN broken_files USING (file)
WHERE map_crop IS NOT NULL AND (file IS NULL OR reason IS NOT NULL);
