-- hard: Each light says truly whether its lane is in the map, and has a state for every timestep.
WITH known AS (
    SELECT DISTINCT dataset, version, map_id, feature_id FROM maps
),
present AS (
    -- Of a shared map that is not at hand nothing can be said here: shared_maps_are_present asks for it.
    SELECT scenario_id FROM metadata_rows WHERE map_crop IS NULL
    UNION ALL
    SELECT scenario_id FROM metadata_rows SEMI JOIN (FROM map_windows WHERE scenario_id IS NULL)
        USING (dataset, version, map_id)
    WHERE map_crop IS NOT NULL
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
LEFT JOIN known AS k
    ON k.dataset = m.dataset AND k.version = m.version AND k.map_id = m.map_id AND k.feature_id = l.lane_id
WHERE
    len(l.state) <> m.num_timesteps
    OR (l.is_lane_in_map <> (k.feature_id IS NOT NULL) AND l.scenario_id IN (FROM present));
