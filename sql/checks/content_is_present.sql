-- lake: Every file that holds a part of the scenario is there, as large as when it was written.
SELECT scenario_id, file || ' is ' || reason AS detail
FROM metadata_rows JOIN broken_files ON file IN (tracks_file, lights_file, maps_file);
