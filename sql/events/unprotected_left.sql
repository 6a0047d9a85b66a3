-- A vehicle turns left across oncoming traffic that no light stops: when its turn begins, or within $within seconds,
-- another vehicle approaches (within 30 degrees of opposite), faster than $min_speed m/s, at most $range metres
-- ahead and on its left side, and no light beside it (20 m) shows a green arrow; ego_only=true considers only the ego.
-- other_id is the nearest oncoming vehicle; value is its distance, in m.
-- Source: the tag starting_unprotected_noncross/cross_turn of nuPlan; MUTCD 4D.17, permissive left turn: made after
-- yielding to oncoming traffic, without a green arrow.
-- range = 60.0
-- within = 2.0
-- min_speed = 2.0
-- ego_only = false
WITH lefts AS (
    SELECT
        t.scenario_id, t.track_id, t.first_timestep, t.last_timestep, m.dt, m.timestamps, m.num_timesteps,
        o.x[first_timestep - o.start + 1] AS x,
        o.y[first_timestep - o.start + 1] AS y,
        o.heading[first_timestep - o.start + 1] AS heading
    FROM turns AS t JOIN tracks AS o USING (scenario_id, track_id) JOIN metadata_rows AS m USING (scenario_id)
    WHERE degrees(angle) BETWEEN 45 AND 135 AND t.object_type = 'VEHICLE' AND (is_ego OR NOT $ego_only)
),
arrows AS (
    SELECT scenario_id, x, y, unnest(range(len(state))) AS timestep, unnest(state) AS state
    FROM stop_lines
    WHERE list_contains(state, 'LANE_STATE_ARROW_GO')
),
begun AS (
    SELECT
        scenario_id, track_id, first_timestep, last_timestep, x, y, heading, dt, timestamps,
        unnest(range(first_timestep, num_timesteps))::INTEGER AS timestep
    FROM lefts AS b
    WHERE NOT EXISTS (
        SELECT 1 FROM arrows AS a
        WHERE a.scenario_id = b.scenario_id AND a.state = 'LANE_STATE_ARROW_GO'
            AND a.timestep BETWEEN b.first_timestep AND b.last_timestep
            AND (a.x - b.x) ** 2 + (a.y - b.y) ** 2 <= 400
    )
),
watched AS (
    SELECT * FROM begun
    WHERE coalesce(timestamps[timestep + 1] - timestamps[first_timestep + 1], (timestep - first_timestep) * dt) <= $within + 1e-6
),
oncoming AS (
    SELECT
        b.scenario_id, b.track_id, o.track_id AS other_id, b.first_timestep, b.last_timestep,
        min((o.x - b.x) * cos(b.heading) + (o.y - b.y) * sin(b.heading)) AS ahead
    FROM watched AS b JOIN object_states AS o USING (scenario_id, timestep)
    WHERE
        o.track_id <> b.track_id AND o.object_type = 'VEHICLE' AND o.speed > $min_speed
        AND cos(o.heading - b.heading) <= -cos(pi() / 6)
        AND (o.x - b.x) * cos(b.heading) + (o.y - b.y) * sin(b.heading) BETWEEN 0 AND $range
        AND (o.y - b.y) * cos(b.heading) - (o.x - b.x) * sin(b.heading) BETWEEN 0 AND 15
    GROUP BY ALL
)
SELECT
    scenario_id,
    track_id,
    arg_min(other_id, (ahead, other_id)) AS other_id,
    first_timestep,
    last_timestep,
    min(ahead) AS value
FROM oncoming
GROUP BY scenario_id, track_id, first_timestep, last_timestep
