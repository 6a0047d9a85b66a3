-- An object is on the lane of a stop sign and approaches it, at most $forward_thresh metres before it. Where the
-- sign is an object itself (Argoverse 2), its lane is the one outside of intersections whose end is nearest, within
-- 10 m; the object is at most 7 m to the left of the sign as drivers see it, and looks at its front. Where it
-- belongs to the map, it names its lanes.
-- forward_thresh = 10.0
WITH signs AS (
    SELECT DISTINCT ON (s.scenario_id, s.track_id)
        s.scenario_id, s.track_id AS sign_id, px, py, s.heading, s.dataset, s.version, s.map_id, lane_id
    FROM source_places AS s JOIN object_states AS t USING (scenario_id, track_id, timestep)
    JOIN lane_outlines USING (dataset, version, map_id)
    WHERE
        source_type = 'STOP_SIGN' AND px BETWEEN min_x - 10 AND max_x + 10 AND py BETWEEN min_y - 10 AND max_y + 10
        AND outline_gap(px, py, xs, ys) <= 10
    ORDER BY timestep, is_intersection, (line_xs[-1] - px) ** 2 + (line_ys[-1] - py) ** 2
),
facing AS (
    SELECT
        p.scenario_id, p.track_id, p.timestep,
        (p.px - s.px) * cos(s.heading) + (p.py - s.py) * sin(s.heading) AS before,
        (p.py - s.py) * cos(s.heading) - (p.px - s.px) * sin(s.heading) AS beside
    FROM source_places AS p JOIN object_lanes USING (scenario_id, track_id, timestep)
    JOIN signs AS s ON s.scenario_id = p.scenario_id AND s.lane_id = object_lanes.lane_id
    WHERE before > -1 AND before < $forward_thresh AND beside > -7 AND beside < 0
        AND abs(wrap_angle(p.heading - s.heading)) >= pi() / 2
),
marked AS (
    SELECT
        dataset, version, map_id, x[1] + origin_x AS sign_x, y[1] + origin_y AS sign_y,
        unnest(controlled_lanes) AS lane_id
    FROM maps
    WHERE feature_type = 'STOP_SIGN' AND len(x) > 0
)
SELECT scenario_id, track_id, timestep FROM facing
UNION
SELECT scenario_id, track_id, timestep
FROM source_places JOIN object_lanes USING (scenario_id, track_id, timestep, dataset, version, map_id)
JOIN marked USING (dataset, version, map_id, lane_id)
WHERE sqrt((px - sign_x) ** 2 + (py - sign_y) ** 2) <= $forward_thresh
