-- lake: Every file with data of the scenario exists, with the bytes that were written.
WITH addressed AS (
    SELECT scenario_id, unnest([tracks_file, lights_file, maps_file]) AS file FROM metadata_rows
)
SELECT scenario_id, file || ' is ' || reason AS detail FROM broken_files LEFT JOIN addressed USING (file);
