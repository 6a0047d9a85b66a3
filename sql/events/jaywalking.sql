-- A pedestrian is on a lane and off every crosswalk for at least $min_duration seconds: within $half_width metres of a
-- lane's centreline, and at least $margin metres from each crosswalk. Maps without crosswalks give no hits; bicycle
-- lanes do not count. Value is the duration, in s.
-- Source: Uniform Vehicle Code 11-503, "Crossing at other than crosswalks".
-- half_width = 1.5
-- margin = 2.0
-- min_duration = 1.0
WITH mapped AS (
    SELECT * FROM metadata_rows SEMI JOIN (SELECT * FROM maps WHERE feature_type = 'CROSSWALK') AS c
        USING (dataset, version, map_id)
),
walkers AS (
    SELECT
        s.scenario_id, s.track_id, s.timestep, m.dataset, m.version, m.map_id,
        coalesce(m.timestamps[s.timestep + 1], s.timestep * m.dt) AS seconds,
        s.x + m.origin_x AS x,
        s.y + m.origin_y AS y
    FROM object_states AS s JOIN mapped AS m USING (scenario_id)
    WHERE object_type = 'PEDESTRIAN'
),
reaches AS (
    SELECT
        scenario_id, dataset, version, map_id,
        min(x) - 5 AS min_x, min(y) - 5 AS min_y, max(x) + 5 AS max_x, max(y) + 5 AS max_y
    FROM walkers
    GROUP BY ALL
),
near AS (
    SELECT r.scenario_id, l.feature_id, l.feature_type, l.origin_x, l.origin_y, l.x, l.y, l.polygon_x, l.polygon_y
    FROM maps AS l JOIN reaches AS r USING (dataset, version, map_id)
    WHERE
        l.min_x + origin_x <= r.max_x AND l.max_x + origin_x >= r.min_x
        AND l.min_y + origin_y <= r.max_y AND l.max_y + origin_y >= r.min_y
),
lanes AS (
    SELECT
        scenario_id,
        x[i] + origin_x AS x, y[i] + origin_y AS y, x[i + 1] - x[i] AS dx, y[i + 1] - y[i] AS dy
    FROM (
        SELECT *, unnest(range(1, len(x))) AS i FROM near
        WHERE starts_with(feature_type, 'LANE_') AND feature_type <> 'LANE_BIKE_LANE'
    )
    WHERE dx <> 0 OR dy <> 0
),
squares AS (
    SELECT *, unnest(range(floor((least(y, y + dy) - $half_width) / 10)::BIGINT, floor((greatest(y, y + dy) + $half_width) / 10)::BIGINT + 1)) AS square_y
    FROM (
        SELECT *, unnest(range(floor((least(x, x + dx) - $half_width) / 10)::BIGINT, floor((greatest(x, x + dx) + $half_width) / 10)::BIGINT + 1)) AS square_x
        FROM lanes
    )
),
on_road AS (
    SELECT DISTINCT p.scenario_id, p.track_id, p.timestep, p.seconds, p.x, p.y
    FROM (SELECT *, floor(x / 10)::BIGINT AS square_x, floor(y / 10)::BIGINT AS square_y FROM walkers) AS p
    JOIN squares AS l USING (scenario_id, square_x, square_y)
    WHERE segment_gap(p.x - l.x, p.y - l.y, l.dx, l.dy) <= $half_width
),
edges AS (
    SELECT
        scenario_id, feature_id,
        polygon_x[i] + origin_x AS x,
        polygon_y[i] + origin_y AS y,
        polygon_x[i % len(polygon_x) + 1] - polygon_x[i] AS dx,
        polygon_y[i % len(polygon_x) + 1] - polygon_y[i] AS dy
    FROM (
        SELECT *, unnest(range(1, len(polygon_x) + 1)) AS i FROM near WHERE feature_type = 'CROSSWALK'
    )
),
crosswalks AS (
    -- A point is inside if a ray from it crosses the outline an odd number of times.
    SELECT
        p.scenario_id, p.track_id, p.timestep, e.feature_id,
        min(segment_gap(p.x - e.x, p.y - e.y, e.dx, e.dy)) < $margin
            OR count_if((e.y > p.y) <> (e.y + e.dy > p.y) AND p.x < e.x + (p.y - e.y) / e.dy * e.dx) % 2 = 1 AS is_on
    FROM on_road AS p JOIN edges AS e USING (scenario_id)
    GROUP BY ALL
),
off AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM on_road ANTI JOIN (SELECT * FROM crosswalks WHERE is_on) AS c USING (scenario_id, track_id, timestep)
)
SELECT
    scenario_id,
    track_id,
    NULL::VARCHAR AS other_id,
    min(timestep) AS first_timestep,
    max(timestep) AS last_timestep,
    max(seconds) - min(seconds) AS value
FROM off
GROUP BY scenario_id, track_id, run
HAVING value >= $min_duration - 1e-6
