-- lake: Every file with data of the scenario exists and has the size recorded when it was written.
SELECT scenario_id, file || ' is ' || reason AS detail
FROM metadata_rows JOIN broken_files ON file IN (tracks_file, lights_file, maps_file);
