-- ISO 34502's table of traffic disturbances away from intersections: road, what the ego does, what the other vehicle does.
-- Roads that are none of these three have rows of their own below.
SELECT
    road,
    CASE WHEN ego_changes_lane THEN 'changes lane' ELSE 'keeps lane' END AS ego,
    count(*) FILTER (definition = 'cut_in') AS cut_in,
    count(*) FILTER (definition = 'cut_out') AS cut_out,
    count(*) FILTER (definition = 'acceleration') AS acceleration,
    count(*) FILTER (definition = 'deceleration') AS deceleration
FROM disturbances
RIGHT JOIN (
    SELECT road, ego_changes_lane
    FROM (SELECT unnest(['road', 'merge', 'branch', 'intersection', 'none']) AS road)
    CROSS JOIN (SELECT unnest([false, true]) AS ego_changes_lane)
) USING (road, ego_changes_lane)
GROUP BY road, ego_changes_lane
ORDER BY list_position(['road', 'merge', 'branch', 'intersection', 'none'], road), ego DESC
