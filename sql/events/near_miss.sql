-- Time to collision with the ego falls below $max seconds, but the boxes never touch. One hit per object; value is the
-- shortest time to collision, in s.
-- Source: Hayward 1972, "Near-miss determination through use of a scale of danger", whose scale calls a time to
-- collision below 1 s a near miss; contacts are excluded.
-- max = 1.0
WITH near AS (
    -- Circles around the boxes are in reach of each other within that time, and pass each other closer than they reach.
    SELECT *, sqrt(v_ahead * v_ahead + v_left * v_left) AS closing
    FROM ego_pairs
    WHERE distance <= $max * closing + reach AND abs(ahead * v_left - "left" * v_ahead) <= reach * closing
),
times AS (
    SELECT
        scenario_id, track_id, ego_id, timestep,
        CASE
            WHEN closing > 0.1
                THEN box_ttc(ahead, "left", turn, v_ahead, v_left, ego_length, ego_width, length, width)
        END AS ttc,
        box_gap(ahead, "left", turn, ego_length, ego_width, length, width) AS gap
    FROM near
)
SELECT
    scenario_id,
    track_id,
    ego_id AS other_id,
    min(timestep) FILTER (ttc < $max) AS first_timestep,
    max(timestep) FILTER (ttc < $max) AS last_timestep,
    min(ttc) AS value
FROM times
GROUP BY scenario_id, track_id, ego_id
HAVING min(ttc) < $max AND min(gap) > 0
