-- hard: The flag is_lane_in_map of each light is correct, and each light has a state for every timestep.
SELECT
    l.scenario_id,
    CASE
        WHEN len(l.state) <> m.num_timesteps
            THEN 'light ' || light_id || ' has ' || len(l.state) || ' states over ' || m.num_timesteps || ' timesteps'
        WHEN l.is_lane_in_map THEN 'light ' || light_id || ' is for lane ' || lane_id || ', which is not in the map'
        ELSE 'light ' || light_id || ' is for lane ' || lane_id || ', which is in the map although the flag denies it'
    END AS detail
FROM lights AS l
JOIN metadata_rows AS m USING (scenario_id)
WHERE
    len(l.state) <> m.num_timesteps
    OR l.is_lane_in_map <> EXISTS (
        SELECT 1
        FROM maps AS f
        WHERE
            f.dataset = m.dataset AND f.version = m.version AND f.map_id = m.map_id AND f.feature_id = l.lane_id
    );
