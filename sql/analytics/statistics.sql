-- Statistics of scenarios: mean, sample standard deviation and range of each measure, and ratios of scenarios with an
-- intersection, construction and lights; extends the table by which the ScenarioNet paper compares databases.
WITH measures AS (
    SELECT unnest([
        {'place': 1, 'measure': 'track length', 'unit': 'm', 'value': ego_distance::DOUBLE},
        {'place': 2, 'measure': 'duration', 'unit': 's', 'value': duration},
        {'place': 3, 'measure': 'mean speed', 'unit': 'm/s', 'value': ego_mean_speed},
        {'place': 4, 'measure': 'highest speed', 'unit': 'm/s', 'value': ego_max_speed},
        {'place': 5, 'measure': 'curvature', 'unit': 'rad', 'value': ego_cumulative_curvature},
        {'place': 6, 'measure': 'difficulty', 'unit': 'm rad', 'value': difficulty},
        {'place': 7, 'measure': 'objects', 'unit': '', 'value': num_objects},
        {'place': 8, 'measure': 'vehicles', 'unit': '', 'value': num_vehicles},
        {'place': 9, 'measure': 'pedestrians', 'unit': '', 'value': num_pedestrians},
        {'place': 10, 'measure': 'cyclists', 'unit': '', 'value': num_cyclists},
        {'place': 11, 'measure': 'moving objects', 'unit': '', 'value': num_moving_objects},
        {'place': 12, 'measure': 'smallest gap', 'unit': 'm', 'value': min_ego_gap},
        {'place': 13, 'measure': 'lanes', 'unit': '', 'value': num_lanes},
        {'place': 14, 'measure': 'lights', 'unit': '', 'value': num_lights},
        {'place': 15, 'measure': 'intersection ratio', 'unit': 'ratio', 'value': has_intersection::INTEGER},
        {'place': 16, 'measure': 'construction ratio', 'unit': 'ratio', 'value': has_construction::INTEGER},
        {'place': 17, 'measure': 'traffic light ratio', 'unit': 'ratio', 'value': (num_lights > 0)::INTEGER}
    ], recursive := true)
    FROM metadata
)
SELECT
    measure,
    unit,
    count(value) AS scenarios,
    avg(value) AS mean,
    CASE WHEN unit <> 'ratio' THEN stddev_samp(value) END AS std,
    min(value) AS min,
    max(value) AS max
FROM measures
GROUP BY place, measure, unit
ORDER BY place;
