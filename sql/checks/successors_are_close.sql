-- soft: A lane ends within 5 m of where its successors begin.
WITH lanes AS (
    SELECT map_id, feature_id, x[1] AS x0, y[1] AS y0, x[-1] AS x1, y[-1] AS y1, origin_x, origin_y, exit_lanes
    FROM maps
    WHERE starts_with(feature_type, 'LANE_')
),
links AS (
    SELECT *, unnest(exit_lanes) AS successor FROM lanes
),
far AS (
    SELECT
        a.map_id,
        a.feature_id || ' -> ' || b.feature_id AS link,
        sqrt((a.x1 - b.x0 + a.origin_x - b.origin_x) ** 2 + (a.y1 - b.y0 + a.origin_y - b.origin_y) ** 2) AS gap
    FROM links AS a JOIN lanes AS b ON b.map_id = a.map_id AND b.feature_id = a.successor
    WHERE gap > 5
),
broken AS (
    SELECT map_id, count(*) AS n, max(gap) AS gap, arg_max(link, gap) AS link FROM far GROUP BY map_id
)
SELECT scenario_id, printf('%d links jump, the widest %s by %.1f m', n, link, gap) AS detail
FROM broken JOIN metadata_rows USING (map_id);
