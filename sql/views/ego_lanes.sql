-- needs: lane_outlines, metadata_rows, ego_states, wrap_angle
-- One row per timestep at which the ego is on a lane: the lane whose centreline is nearest, within 2.5 m and 45 degrees
-- of the ego's position and heading.
CREATE VIEW ego_lanes AS
WITH egos AS (
    SELECT *, floor(x / 5)::INTEGER AS square_x, floor(y / 5)::INTEGER AS square_y
    FROM (
        SELECT
            scenario_id, e.track_id, e.timestep, e.seconds, e.heading,
            e.x + m.origin_x AS x,  -- in the source frame, which a shared map and its scenarios have in common
            e.y + m.origin_y AS y
        FROM ego_states AS e JOIN metadata_rows AS m USING (scenario_id)
    )
),
visited AS (
    SELECT DISTINCT scenario_id, square_x, square_y FROM egos
),
reaches AS (
    SELECT
        scenario_id, min(x) - 5 AS "left", max(x) + 5 AS "right", min(y) - 5 AS low, max(y) + 5 AS high
    FROM egos
    GROUP BY scenario_id
),
lanes AS (
    SELECT r.scenario_id, lane_id, line_xs, line_ys, unnest(range(1, len(line_xs))) AS i
    FROM reaches AS r JOIN metadata_rows USING (scenario_id) JOIN lane_outlines AS l USING (dataset, version, map_id)
    WHERE
        lane_type <> 'BIKE' AND l.min_x <= "right" AND l.max_x >= "left" AND l.min_y <= high AND l.max_y >= low
),
segments AS (
    SELECT
        scenario_id, lane_id, line_xs[i] AS x, line_ys[i] AS y, line_xs[i + 1] - x AS dx, line_ys[i + 1] - y AS dy,
        dx * dx + dy * dy AS squared, atan2(dy, dx) AS direction
    FROM lanes
    WHERE squared > 0
),
squares AS (
    -- A segment belongs to every 5 m cell that its box, widened by 2.5 m, intersects.
    SELECT *, unnest(range(floor((least(y, y + dy) - 2.5) / 5)::INTEGER, floor((greatest(y, y + dy) + 2.5) / 5)::INTEGER + 1))::INTEGER AS square_y
    FROM (
        SELECT *, unnest(range(floor((least(x, x + dx) - 2.5) / 5)::INTEGER, floor((greatest(x, x + dx) + 2.5) / 5)::INTEGER + 1))::INTEGER AS square_x
        FROM segments
    )
),
beside AS (
    SELECT
        e.scenario_id, e.track_id, e.timestep, e.seconds, l.lane_id,
        least(greatest(((e.x - l.x) * dx + (e.y - l.y) * dy) / squared, 0), 1) AS share,
        (e.x - l.x - share * dx) * (e.x - l.x - share * dx) + (e.y - l.y - share * dy) * (e.y - l.y - share * dy) AS apart
    FROM egos AS e
    JOIN (SELECT * FROM squares SEMI JOIN visited USING (scenario_id, square_x, square_y)) AS l
        USING (scenario_id, square_x, square_y)
    WHERE abs(wrap_angle(e.heading - direction)) <= pi() / 4 AND apart <= 2.5 * 2.5
)
SELECT scenario_id, track_id, timestep, seconds, dataset, version, map_id, lane_id, apart
FROM (
    SELECT
        scenario_id, track_id, timestep, any_value(seconds) AS seconds,
        arg_min(lane_id, (apart, lane_id)) AS lane_id, sqrt(min(apart)) AS apart
    FROM beside
    GROUP BY scenario_id, track_id, timestep
)
JOIN metadata_rows USING (scenario_id);
