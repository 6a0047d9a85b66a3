-- needs: maps, sideways, wrap_angle
-- One row per lane of a map: its outline `xs`, `ys` and its centreline `line_xs`, `line_ys` in the source's frame
-- [m]. Where the source has no outline, it runs beside the centreline, at its widths or at 1.75 m to each side
-- (bicycle lanes: 0.75 m), through a point about every 2 m. `lane_heading` [rad] is the direction from the first to
-- the last point of the centreline; `turns` is 1 for a lane that turns left by more than 30 degrees, -1 to the
-- right, 0 otherwise. `lane_type` is VEHICLE, BIKE, or the source's own word, such as BUS.
-- kept: relations read it again and again
CREATE VIEW lane_outlines AS
WITH lanes AS (
    SELECT
        *,
        greatest(
            1, (2 * len(x) / greatest(1, sqrt((max_x - min_x) ** 2 + (max_y - min_y) ** 2)))::INTEGER
        ) AS every,
        list_filter(range(1, len(x) + 1), lambda i: i % every = 0 OR i = 1 OR i = len(x)) AS kept,
        CASE feature_type WHEN 'LANE_BIKE_LANE' THEN 0.75 ELSE 1.75 END AS half
    FROM maps
    WHERE starts_with(feature_type, 'LANE_') AND len(x) > 1
),
strips AS (
    SELECT
        *,
        CASE WHEN len(polygon_x) < 3 THEN
            sideways(
                list_select(x, kept), list_select(y, kept),
                CASE len(width_left) WHEN 0 THEN [half] WHEN 1 THEN width_left ELSE list_select(width_left, kept) END, 1
            )
            || list_reverse(sideways(
                list_select(x, kept), list_select(y, kept),
                CASE len(width_right) WHEN 0 THEN [half] WHEN 1 THEN width_right ELSE list_select(width_right, kept) END, -1
            ))
        END AS strip
    FROM lanes
)
SELECT
    dataset, version, map_id, feature_id AS lane_id,
    CASE
        WHEN feature_type = 'LANE_BIKE_LANE' THEN 'BIKE'
        ELSE coalesce(extras ->> 'lane_type', 'VEHICLE')
    END AS lane_type,
    is_intersection, entry_lanes, exit_lanes, left_neighbors, right_neighbors,
    list_transform(coalesce(list_transform(strip, lambda p: p[1]), polygon_x), lambda v: v + origin_x) AS xs,
    list_transform(coalesce(list_transform(strip, lambda p: p[2]), polygon_y), lambda v: v + origin_y) AS ys,
    list_transform(x, lambda v: v + origin_x) AS line_xs,
    list_transform(y, lambda v: v + origin_y) AS line_ys,
    list_min(xs) AS min_x,
    list_max(xs) AS max_x,
    list_min(ys) AS min_y,
    list_max(ys) AS max_y,
    atan2(y[-1] - y[1], x[-1] - x[1]) AS lane_heading,
    wrap_angle(atan2(y[-1] - y[-2], x[-1] - x[-2]) - atan2(y[2] - y[1], x[2] - x[1])) AS turned,
    CASE WHEN abs(turned) > pi() / 6 THEN sign(turned)::INTEGER ELSE 0 END AS turns
FROM strips;
