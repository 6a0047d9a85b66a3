-- needs: maps, metadata_rows, ego_states, wrap_angle
-- One row per timestep at which the ego is on a lane: the lane whose centreline is nearest, within 2.5 m and 45 degrees
-- of the ego's position and heading.
CREATE VIEW ego_lanes AS
WITH egos AS (
    SELECT
        e.scenario_id, e.track_id, e.timestep, e.seconds, e.heading, e.speed, m.dataset, m.version, m.map_id,
        e.x + m.origin_x AS x,  -- in the source frame, which a shared map and its scenarios have in common
        e.y + m.origin_y AS y
    FROM ego_states AS e JOIN metadata_rows AS m USING (scenario_id)
),
reaches AS (
    SELECT
        scenario_id, dataset, version, map_id,
        min(x) - 5 AS min_x, min(y) - 5 AS min_y, max(x) + 5 AS max_x, max(y) + 5 AS max_y
    FROM egos
    GROUP BY ALL
),
lanes AS (
    SELECT r.scenario_id, l.feature_id AS lane_id, l.origin_x, l.origin_y, l.x, l.y, unnest(range(1, len(l.x))) AS i
    FROM maps AS l JOIN reaches AS r USING (dataset, version, map_id)
    WHERE
        starts_with(feature_type, 'LANE_') AND feature_type <> 'LANE_BIKE_LANE'
        AND l.min_x + origin_x <= r.max_x AND l.max_x + origin_x >= r.min_x
        AND l.min_y + origin_y <= r.max_y AND l.max_y + origin_y >= r.min_y
),
segments AS (
    SELECT
        scenario_id, lane_id, i, x[i] + origin_x AS x, y[i] + origin_y AS y, x[i + 1] - x[i] AS dx, y[i + 1] - y[i] AS dy
    FROM lanes
    WHERE dx <> 0 OR dy <> 0
),
squares AS (
    -- A segment belongs to every 10 m cell that its box, widened by 2.5 m, intersects.
    SELECT *, unnest(range(floor((least(y, y + dy) - 2.5) / 10)::BIGINT, floor((greatest(y, y + dy) + 2.5) / 10)::BIGINT + 1)) AS square_y
    FROM (
        SELECT *, unnest(range(floor((least(x, x + dx) - 2.5) / 10)::BIGINT, floor((greatest(x, x + dx) + 2.5) / 10)::BIGINT + 1)) AS square_x
        FROM segments
    )
),
beside AS (
    SELECT
        e.*, l.lane_id,
        least(greatest(((e.x - l.x) * dx + (e.y - l.y) * dy) / (dx * dx + dy * dy), 0), 1) AS share,
        (e.x - l.x - share * dx) ** 2 + (e.y - l.y - share * dy) ** 2 AS apart
    FROM (SELECT *, floor(x / 10)::BIGINT AS square_x, floor(y / 10)::BIGINT AS square_y FROM egos) AS e
    JOIN squares AS l USING (scenario_id, square_x, square_y)
    WHERE apart <= 2.5 * 2.5 AND abs(wrap_angle(e.heading - atan2(dy, dx))) <= pi() / 4
)
SELECT
    scenario_id,
    track_id,
    timestep,
    any_value(seconds) AS seconds,
    any_value(dataset) AS dataset,
    any_value(version) AS version,
    any_value(map_id) AS map_id,
    arg_min(lane_id, (apart, lane_id)) AS lane_id,
    sqrt(min(apart)) AS apart
FROM beside
GROUP BY scenario_id, track_id, timestep;
