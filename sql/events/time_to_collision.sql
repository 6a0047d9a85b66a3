-- The ego and an object would collide within $max seconds if both kept their velocities and headings. A hit lasts as
-- long as this holds without interruption; value is the shortest time to collision, in s.
-- Source: Hayward 1972, "Near-miss determination through use of a scale of danger"; of rectangles, as in nuPlan's
-- closed-loop metric; 1.5 s is the threshold of a conflict in FHWA-HRT-08-051 (SSAM).
-- max = 1.5
WITH near AS (
    -- Circles around the boxes are in reach of each other within that time, and pass each other closer than they reach.
    SELECT *, sqrt(v_ahead * v_ahead + v_left * v_left) AS closing
    FROM ego_pairs
    WHERE distance <= $max * closing + reach AND abs(ahead * v_left - "left" * v_ahead) <= reach * closing
),
times AS (
    SELECT
        scenario_id, track_id, ego_id, timestep,
        box_ttc(ahead, "left", turn, v_ahead, v_left, ego_length, ego_width, length, width) AS ttc
    FROM near
    WHERE closing > 0.1
),
critical AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM times
    WHERE ttc <= $max
)
SELECT
    scenario_id,
    track_id,
    ego_id AS other_id,
    min(timestep) AS first_timestep,
    max(timestep) AS last_timestep,
    min(ttc) AS value
FROM critical
GROUP BY scenario_id, track_id, ego_id, run
