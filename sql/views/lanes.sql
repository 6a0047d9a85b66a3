-- needs: maps
-- One row per lane of a map, with its bounding box in the source's frame [m].
CREATE VIEW lanes AS
SELECT
    dataset,
    version,
    map_id,
    feature_id,
    entry_lanes,
    exit_lanes,
    origin_x + min_x AS min_x,
    origin_y + min_y AS min_y,
    origin_x + max_x AS max_x,
    origin_y + max_y AS max_y,
    origin_x + x[1] AS start_x,
    origin_y + y[1] AS start_y,
    origin_x + x[-1] AS end_x,
    origin_y + y[-1] AS end_y
FROM maps
WHERE starts_with(feature_type, 'LANE_');
