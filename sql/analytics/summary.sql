-- Contents of a lake by dataset, version and split.
SELECT
    dataset,
    version,
    split,
    count(*) AS scenarios,
    sum(num_objects)::BIGINT AS total_objects,
    sum(num_states)::BIGINT AS total_states,
    round(sum(num_timesteps * mean_step) / 3600, 3) AS hours,
    round(avg(ego_distance), 1) AS mean_ego_distance,
    round(avg(num_vehicles), 1) AS mean_vehicles
FROM metadata
GROUP BY ALL
ORDER BY ALL;
