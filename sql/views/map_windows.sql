-- needs: maps, metadata_rows
-- One row per scenario with a map, and one per shared map itself (scenario_id is null): the part of the map that is
-- meant, in the source's frame [m]. A scenario sees the features that meet its window; `is_whole`: every feature.
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
