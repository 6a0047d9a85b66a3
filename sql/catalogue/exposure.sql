-- Rounded, so that they are the same to the last bit wherever they are computed.
-- How far and how long the egos drove, by scenario and road.
SELECT
    scenario_id, any_value(content_hash) AS content_hash, any_value(dataset) AS dataset, any_value(version) AS version,
    any_value(coalesce(city, 'unknown')) AS place, road, round(sum(meters), 6) AS meters,
    round(sum(duration), 6) AS seconds
FROM ego_roads JOIN (SELECT scenario_id, content_hash, dataset, version, city FROM metadata) USING (scenario_id)
GROUP BY scenario_id, road
ORDER BY scenario_id, road
