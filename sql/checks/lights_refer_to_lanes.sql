-- hard: Each light says truly whether its lane is in the map, and has a state for every timestep.
WITH known AS (
    SELECT DISTINCT map_id, feature_id FROM maps
)
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
LEFT JOIN known AS k ON k.map_id = m.map_id AND k.feature_id = l.lane_id
WHERE len(l.state) <> m.num_timesteps OR l.is_lane_in_map <> (k.feature_id IS NOT NULL);
