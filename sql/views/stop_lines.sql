-- needs: lights, maps, metadata_rows
-- One row per recorded light whose lane is in the map: the stop point (`x`, `y` [m], scenario frame; the lane's first
-- point if the source does not record it) and the lane's direction there (`heading` [rad]).
CREATE VIEW stop_lines AS
WITH lanes AS (
    SELECT
        o.scenario_id, o.light_id, o.lane_id, o.stop_x, o.stop_y, o.state,
        l.origin_x - m.origin_x AS shift_x,
        l.origin_y - m.origin_y AS shift_y,
        l.x, l.y,
        unnest(range(1, len(l.x))) AS i
    FROM lights AS o
    JOIN metadata_rows AS m USING (scenario_id)
    JOIN maps AS l ON
        l.dataset = m.dataset AND l.version = m.version AND l.map_id = m.map_id AND l.feature_id = o.lane_id
),
points AS (
    SELECT
        scenario_id, light_id, lane_id, state, i,
        coalesce(stop_x, x[1] + shift_x) AS stop_x,
        coalesce(stop_y, y[1] + shift_y) AS stop_y,
        atan2(y[i + 1] - y[i], x[i + 1] - x[i]) AS heading,
        (x[i] + shift_x - coalesce(stop_x, x[1] + shift_x)) ** 2
            + (y[i] + shift_y - coalesce(stop_y, y[1] + shift_y)) ** 2 AS apart
    FROM lanes
)
SELECT
    scenario_id,
    light_id,
    lane_id,
    stop_x AS x,
    stop_y AS y,
    arg_min(heading, (apart, i)) AS heading,
    any_value(state) AS state
FROM points
GROUP BY scenario_id, light_id, lane_id, stop_x, stop_y;
