-- Time to collision with the ego falls below $max seconds, but the boxes never touch. One hit per object; value is the
-- shortest time to collision, in s.
-- Source: Hayward 1972, "Near-miss determination through use of a scale of danger", whose scale calls a time to
-- collision below 1 s a near miss; contacts are excluded.
-- max = 1.0
WITH near AS (
    SELECT *
    FROM ego_pairs
    WHERE
        distance <= $max * sqrt(v_ahead ** 2 + v_left ** 2)
            + sqrt(length ** 2 + width ** 2) / 2 + sqrt(ego_length ** 2 + ego_width ** 2) / 2
),
times AS (
    SELECT
        scenario_id, track_id, ego_id, timestep,
        CASE
            WHEN sqrt(v_ahead ** 2 + v_left ** 2) > 0.1
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
