-- needs: tracks, stop_lines, metadata_rows, wrap_angle
-- One row per vehicle, timestep and stop line whose light is red then, when the vehicle is within 20 m of it, in its
-- lane (2 m to either side) and within 45 degrees of its direction: `before` [m] is the distance from the vehicle's
-- front to the line, negative beyond it.
-- kept: events read it again and again
CREATE VIEW at_red AS
WITH lines AS (
    SELECT
        * EXCLUDE (state), cos(heading) AS line_cos, sin(heading) AS line_sin,
        list_transform(state, lambda s: s IN ('LANE_STATE_STOP', 'LANE_STATE_ARROW_STOP', 'TRAFFIC_LIGHT_RED')) AS is_red
    FROM stop_lines
),
boxes AS (
    SELECT
        *, list_min(x) AS min_x, list_max(x) AS max_x, list_min(y) AS min_y, list_max(y) AS max_y,
        20 + list_max(length) / 2 AS reach
    FROM tracks
    WHERE object_type = 'VEHICLE'
),
spans AS (
    -- Most vehicles stay away from most lines and need not be expanded. (Zeros at unobserved steps do not matter.)
    SELECT
        o.scenario_id, o.track_id, l.light_id, l.lane_id, is_red, start, valid,
        l.x AS line_x, l.y AS line_y, line_cos, line_sin, l.heading AS line_heading,
        o.x, o.y, o.heading, o.vx, o.vy, o.length,
        unnest(range(len(o.x))) + 1 AS i  -- lists are 1-based
    FROM boxes AS o JOIN lines AS l ON
        l.scenario_id = o.scenario_id
        AND min_x <= l.x + reach * abs(line_cos) + 2 * abs(line_sin) AND max_x >= l.x - reach * abs(line_cos) - 2 * abs(line_sin)
        AND min_y <= l.y + reach * abs(line_sin) + 2 * abs(line_cos) AND max_y >= l.y - reach * abs(line_sin) - 2 * abs(line_cos)
),
beside AS (
    SELECT
        scenario_id, track_id, (start + i - 1)::INTEGER AS timestep,
        sqrt(vx[i] * vx[i] + vy[i] * vy[i]) AS speed,
        light_id, lane_id,
        wrap_angle(heading[i] - line_heading) AS turn,
        (line_x - x[i]) * line_cos + (line_y - y[i]) * line_sin - length[least(i, len(length))] / 2 AS before,
        (y[i] - line_y) * line_cos - (x[i] - line_x) * line_sin AS "left"
    FROM spans
    WHERE
        (valid IS NULL OR valid[i]) AND is_red[start + i]
        AND abs("left") <= 2 AND abs(before) <= 20 AND abs(turn) <= pi() / 4
)
SELECT b.*, m.ego_id, m.dt, coalesce(m.timestamps[b.timestep + 1], b.timestep * m.dt) AS seconds
FROM beside AS b JOIN metadata_rows AS m USING (scenario_id);
