-- needs: tracks, metadata_rows, ego_path, ego_progress, wrap_angle
-- One row per object and timestep at which its centre is within 4 m of the ego's complete path: its position in the
-- frame of the path. `ahead` [m] is the distance ahead of the ego along the path, `left` [m] the distance to the left
-- of the path, `turn` [rad] the heading relative to the path, `ego_passes` [s] the time at which the ego's centre is
-- there, null beyond the recording, and `ego_passing_speed` [m/s] the ego's speed at that time.
-- kept: relations and events read it again and again
CREATE VIEW ego_corridor AS
WITH points AS MATERIALIZED (
    SELECT *, cos(heading) AS heading_x, sin(heading) AS heading_y, row_number() OVER () AS point FROM ego_path
),
paths AS MATERIALIZED (
    -- Integer keys instead of scenario ids, because millions of states are joined by them.
    SELECT
        scenario_id, row_number() OVER () AS number,
        min(x) - 4 AS min_x, min(y) - 4 AS min_y, max(x) + 4 AS max_x, max(y) + 4 AS max_y
    FROM points
    GROUP BY scenario_id
),
columns_of_squares AS (
    SELECT number, point, x, y, floor(x / 2)::INTEGER + unnest([-2, -1, 0, 1, 2]) AS square_x
    FROM points JOIN (SELECT scenario_id, number FROM paths) USING (scenario_id)
),
squares AS (
    SELECT *, floor(y / 2)::INTEGER + unnest([-2, -1, 0, 1, 2]) AS square_y FROM columns_of_squares
),
surface AS (
    -- The plane within 4 m of the path in squares of 2 m, each with the point of the path nearest to its middle: a state
    -- is joined with one point instead of all points near it.
    SELECT
        number, square_x, square_y,
        arg_min(
            point, (x - 2 * square_x - 1) * (x - 2 * square_x - 1) + (y - 2 * square_y - 1) * (y - 2 * square_y - 1)
        ) AS point
    FROM squares
    GROUP BY number, square_x, square_y
),
spans AS (
    -- Most tracks stay away from the path and need not be expanded. (Zeros at unobserved steps do not matter.)
    SELECT number, ego_id, t.*, unnest(range(len(t.x))) + 1 AS i  -- lists are 1-based
    FROM tracks AS t JOIN paths AS p USING (scenario_id) JOIN metadata_rows USING (scenario_id)
    WHERE
        list_min(t.x) <= p.max_x AND list_max(t.x) >= p.min_x AND list_min(t.y) <= p.max_y AND list_max(t.y) >= p.min_y
        AND t.track_id <> ego_id
),
positions AS (
    SELECT
        number, scenario_id, ego_id, track_id, object_type, (start + i - 1)::INTEGER AS timestep,
        x[i] AS x, y[i] AS y, heading[i] AS heading,
        sqrt(vx[i] * vx[i] + vy[i] * vy[i]) AS speed,
        length[least(i, len(length))] AS length,
        width[least(i, len(width))] AS width,
        floor(x[i] / 2)::INTEGER AS square_x,
        floor(y[i] / 2)::INTEGER AS square_y
    FROM spans
    WHERE valid IS NULL OR valid[i]
),
placed AS (
    SELECT
        o.*, s, seconds AS passes, p.speed AS passing_speed,
        wrap_angle(o.heading - p.heading) AS turn,
        (o.x - p.x) * heading_x + (o.y - p.y) * heading_y AS along,
        (o.y - p.y) * heading_x - (o.x - p.x) * heading_y AS "left"
    FROM positions AS o JOIN surface USING (number, square_x, square_y) JOIN points AS p USING (point)
    WHERE abs("left") <= 4
)
SELECT
    scenario_id,
    o.track_id,
    o.object_type,
    o.ego_id,
    timestep,
    e.seconds,
    o.s + o.along - e.s AS ahead,
    o.left,
    o.turn,
    o.speed,
    o.length,
    o.width,
    e.speed AS ego_speed,
    e.length AS ego_length,
    e.width AS ego_width,
    o.passes + o.along / greatest(o.passing_speed, 0.1) AS ego_passes,
    o.passing_speed AS ego_passing_speed
FROM placed AS o JOIN ego_progress AS e USING (scenario_id, timestep);
