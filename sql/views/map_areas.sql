-- needs: maps
-- One row per feature of a map with an outline that is no lane, such as crosswalks and drivable areas; the outline
-- and its bounding box are in the source's frame [m].
-- kept: relations read it again and again
CREATE VIEW map_areas AS
SELECT
    dataset, version, map_id, feature_id, feature_type,
    list_transform(polygon_x, lambda v: v + origin_x) AS xs,
    list_transform(polygon_y, lambda v: v + origin_y) AS ys,
    min_x + origin_x AS min_x,
    min_y + origin_y AS min_y,
    max_x + origin_x AS max_x,
    max_y + origin_y AS max_y
FROM maps
WHERE len(polygon_x) > 2 AND NOT starts_with(feature_type, 'LANE_');
