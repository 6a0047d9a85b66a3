-- hard: Each timestep has a timestamp; timestamps start at 0 and increase strictly; dt is positive.
SELECT
    scenario_id,
    CASE
        WHEN num_timesteps < 1 THEN num_timesteps || ' timesteps'
        WHEN NOT dt > 0 THEN 'dt is ' || dt
        WHEN len(timestamps) <> num_timesteps THEN len(timestamps) || ' timestamps of ' || num_timesteps
        WHEN timestamps[1] <> 0 THEN 'the first is ' || timestamps[1]
        WHEN NOT list_bool_and(
            list_transform(range(1, num_timesteps), lambda i: timestamps[i + 1] > timestamps[i])
        ) THEN 'a timestamp is not after the one before'
    END AS detail
FROM metadata_rows
WHERE detail IS NOT NULL;
