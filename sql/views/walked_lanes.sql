-- needs: walks, lane_outlines, lanes_along
-- One row per object that is ever on a lane, by the smoothed centre of its box: `lanes` are those near it, and the lists
-- in `found`, over its `timesteps`, name the `lane` it is on (its number in `lanes`, from 1, null off the lanes), and how
-- far it is to the left of its middle (`aside` [m]). Where lanes overlap, as on intersections, it is on the lane that
-- holds most of its timesteps, then on the one that holds most of the rest, and so on; of equal ones on that which turns
-- as it does (up to 0.15 rad/s is straight on).
-- kept: relations read it again and again
CREATE VIEW walked_lanes AS
WITH near AS (
    SELECT
        scenario_id, track_id,
        list({
            'turns': turns, 'is_intersection': is_intersection, 'xs': xs, 'ys': ys, 'line_xs': line_xs, 'line_ys': line_ys
        } ORDER BY lane_id) AS outlines,
        list({
            'lane_id': lane_id, 'lane_type': lane_type, 'is_intersection': is_intersection, 'lane_heading': lane_heading
        } ORDER BY lane_id) AS lanes
    FROM walks JOIN lane_outlines USING (dataset, version, map_id)
    WHERE min_x <= "right" AND max_x >= "left" AND min_y <= high AND max_y >= low
    GROUP BY scenario_id, track_id
)
SELECT
    scenario_id, track_id, dataset, version, map_id, timesteps, lanes,
    lanes_along(steps.origin_x, steps.origin_y, steps.x, steps.y, steps.yaw_rate, outlines) AS found
FROM walks JOIN near USING (scenario_id, track_id);
