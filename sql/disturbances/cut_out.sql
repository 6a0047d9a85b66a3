-- The vehicle ahead of the ego leaves its lane: from when its centre was last within 0.9 m of the ego's path, as the
-- nearest one ahead, until its near side is 0.3 m inside of the marking. Parameters, at that time: `ego_speed`, `speed`
-- [m/s], `gap` [m] from bumper to bumper, `lateral_speed` [m/s], and of the next vehicle ahead, which is revealed, at
-- most 100 m further on: `revealed_gap` [m] from bumper to bumper and `revealed_speed` [m/s]; null if there is none. The
-- gap is at most $max_gap, both are faster than $min_speed.
-- Source: UN Regulation 157, annex 4, appendix 3: cut-out with Ve0, Vo0, dx0, Vy and the distance dx0_f to a stopped
-- vehicle ahead. ISO 34502: traffic disturbance, cut-out. Lane, means and limits are our reading, and so is that the
-- revealed vehicle may move.
-- max_gap = 60.0
-- min_speed = 2.0
WITH leaving AS (
    SELECT c.*
    FROM corridor_crossings AS c JOIN ego_leads AS l ON
        l.scenario_id = c.scenario_id AND l.track_id = c.track_id AND l.timestep = c.middle
    WHERE direction > 0 AND c.gap BETWEEN 0 AND $max_gap AND least(c.speed, c.ego_speed) > $min_speed
),
revealed AS (
    SELECT
        l.scenario_id, l.track_id, l.timestep,
        min(
            coalesce(s.before.ahead + share * (s.ahead - s.before.ahead), s.ahead) - crosses_ahead
            - (s.length + l.length) / 2
        ) AS revealed_gap,
        arg_min(s.speed, s.ahead) AS revealed_speed
    FROM leaving AS l JOIN corridor_steps AS s ON
        s.scenario_id = l.scenario_id AND s.timestep = l.timestep AND s.track_id <> l.track_id
        AND abs(s.aside) <= 1.5 AND s.ahead > l.ahead
    GROUP BY l.scenario_id, l.track_id, l.timestep
    HAVING revealed_gap <= 100
)
SELECT
    scenario_id, track_id, ego_id AS other_id, middle AS first_timestep, timestep AS last_timestep, gap AS value,
    ego_speed, speed, gap, lateral_speed, revealed_gap, revealed_speed
FROM leaving LEFT JOIN revealed USING (scenario_id, track_id, timestep)
