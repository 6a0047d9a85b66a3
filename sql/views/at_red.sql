-- needs: object_states, stop_lines, metadata_rows, wrap_angle
-- One row per vehicle, timestep and stop line whose light is red then, when the vehicle is within 20 m of it, in its
-- lane (2 m to either side) and within 45 degrees of its direction: `before` [m] is the distance from the vehicle's
-- front to the line, negative beyond it.
CREATE VIEW at_red AS
WITH red AS (
    SELECT
        *, floor(x / 20)::INTEGER AS square_x, floor(y / 20)::INTEGER AS square_y, unnest(range(len(state))) AS timestep
    FROM stop_lines
    WHERE list_has_any(state, ['LANE_STATE_STOP', 'LANE_STATE_ARROW_STOP', 'TRAFFIC_LIGHT_RED'])
),
near AS (
    SELECT
        scenario_id, light_id, lane_id, x, y, heading, timestep,
        square_x + unnest([-1, -1, -1, 0, 0, 0, 1, 1, 1]) AS square_x,
        square_y + unnest([-1, 0, 1, -1, 0, 1, -1, 0, 1]) AS square_y
    FROM red
    WHERE state[timestep + 1] IN ('LANE_STATE_STOP', 'LANE_STATE_ARROW_STOP', 'TRAFFIC_LIGHT_RED')
),
beside AS (
    SELECT
        o.scenario_id, o.track_id, o.timestep, o.speed, l.light_id, l.lane_id,
        wrap_angle(o.heading - l.heading) AS turn,
        (l.x - o.x) * cos(l.heading) + (l.y - o.y) * sin(l.heading) - o.length / 2 AS before,
        (o.y - l.y) * cos(l.heading) - (o.x - l.x) * sin(l.heading) AS "left"
    FROM (
        SELECT *, floor(x / 20)::INTEGER AS square_x, floor(y / 20)::INTEGER AS square_y
        FROM object_states
        WHERE object_type = 'VEHICLE'
    ) AS o
    JOIN near AS l USING (scenario_id, timestep, square_x, square_y)
    WHERE abs("left") <= 2 AND abs(before) <= 20 AND abs(turn) <= pi() / 4
)
SELECT b.*, m.ego_id, m.dt, coalesce(m.timestamps[b.timestep + 1], b.timestep * m.dt) AS seconds
FROM beside AS b JOIN metadata_rows AS m USING (scenario_id);
