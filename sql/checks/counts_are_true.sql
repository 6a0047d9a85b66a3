-- lake: The counts in metadata equal the numbers of rows in tracks, lights and maps; crops of shared maps are not counted.
WITH track_counts AS (
    SELECT
        scenario_id,
        count(*) AS tracks_num_rows,
        count_if(len(x) > 0) AS num_objects,
        count_if(len(x) > 0 AND object_type = 'VEHICLE') AS num_vehicles,
        count_if(len(x) > 0 AND object_type = 'PEDESTRIAN') AS num_pedestrians,
        count_if(len(x) > 0 AND object_type = 'CYCLIST') AS num_cyclists,
        count_if(len(x) > 0 AND object_type = 'TRAFFIC_CONE') AS num_cones,
        count_if(len(x) > 0 AND object_type = 'TRAFFIC_BARRIER') AS num_barriers,
        sum(CASE WHEN valid IS NULL THEN len(x) ELSE list_sum(valid::INTEGER[]) END) AS num_states
    FROM tracks
    GROUP BY scenario_id
),
light_counts AS (
    SELECT scenario_id, count(*) AS num_lights FROM lights GROUP BY scenario_id
),
map_counts AS (
    SELECT
        map_id, count(*) AS num_map_features, count_if(starts_with(feature_type, 'LANE_')) AS num_lanes
    FROM maps
    GROUP BY map_id
),
compared AS (
    SELECT
        m.scenario_id,
        unnest([
            {'name': 'tracks_num_rows', 'said': m.tracks_num_rows, 'found': t.tracks_num_rows},
            {'name': 'num_objects', 'said': m.num_objects, 'found': t.num_objects},
            {'name': 'num_vehicles', 'said': m.num_vehicles, 'found': t.num_vehicles},
            {'name': 'num_pedestrians', 'said': m.num_pedestrians, 'found': t.num_pedestrians},
            {'name': 'num_cyclists', 'said': m.num_cyclists, 'found': t.num_cyclists},
            {'name': 'num_cones', 'said': m.num_cones, 'found': t.num_cones},
            {'name': 'num_barriers', 'said': m.num_barriers, 'found': t.num_barriers},
            {'name': 'num_states', 'said': m.num_states, 'found': t.num_states},
            {'name': 'num_lights', 'said': m.num_lights, 'found': l.num_lights},
            {'name': 'num_map_features', 'said': m.num_map_features, 'found': CASE WHEN m.map_crop IS NULL THEN f.num_map_features ELSE m.num_map_features END},
            {'name': 'num_lanes', 'said': m.num_lanes, 'found': CASE WHEN m.map_crop IS NULL THEN f.num_lanes ELSE m.num_lanes END}
        ], recursive := true)
    FROM metadata_rows AS m
    LEFT JOIN track_counts AS t USING (scenario_id)
    LEFT JOIN light_counts AS l USING (scenario_id)
    LEFT JOIN map_counts AS f USING (map_id)
)
SELECT scenario_id, name || ' is ' || said || ', found ' || coalesce(found, 0) AS detail
FROM compared
WHERE said <> coalesce(found, 0);
