-- needs: lights, maps, metadata_rows
-- One row per recorded light whose lane is in the map: the stop point (`x`, `y` [m], scenario frame; the lane's first
-- point if the source does not record it) and the lane's direction there (`heading` [rad]).
-- kept: views and events read it again and again
CREATE VIEW stop_lines AS
WITH lanes AS (
    SELECT
        m.scenario_id, o.light_id, o.lane_id, o.state, l.x, l.y,
        l.origin_x - m.origin_x AS shift_x,
        l.origin_y - m.origin_y AS shift_y,
        coalesce(stop_x, x[1] + shift_x) AS stop_x,
        coalesce(stop_y, y[1] + shift_y) AS stop_y
    FROM lights AS o
    JOIN metadata_rows AS m USING (scenario_id)
    JOIN maps AS l ON
        l.dataset = m.dataset AND l.version = m.version AND l.map_id = m.map_id AND l.feature_id = o.lane_id
    WHERE len(l.x) > 1
)
SELECT
    scenario_id,
    light_id,
    lane_id,
    stop_x AS x,
    stop_y AS y,
    list_min(list_transform(range(1, len(lanes.x)), lambda i: {
        'apart': (lanes.x[i] + shift_x - stop_x) ** 2 + (lanes.y[i] + shift_y - stop_y) ** 2,
        'i': i,
        'heading': atan2(lanes.y[i + 1] - lanes.y[i], lanes.x[i + 1] - lanes.x[i])
    })).heading AS heading,
    state
FROM lanes;
