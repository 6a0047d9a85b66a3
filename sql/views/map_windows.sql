-- needs: maps, metadata_rows
-- One row per scenario with a map, and one per shared map itself (scenario_id is null): its part of the map
-- in the source frame [m]. A scenario has the features that intersect its window, or all of them if `is_whole`.
CREATE VIEW map_windows AS
SELECT
    scenario_id,
    dataset,
    version,
    map_id,
    map_crop IS NULL AS is_whole,
    origin_x + map_crop[1] AS min_x,
    origin_y + map_crop[2] AS min_y,
    origin_x + map_crop[3] AS max_x,
    origin_y + map_crop[4] AS max_y
FROM metadata_rows
WHERE map_id IS NOT NULL
UNION ALL
SELECT DISTINCT NULL, dataset, version, map_id, true, NULL, NULL, NULL, NULL
FROM maps
WHERE tile IS NOT NULL;
