-- Smallest gap between the boxes of the ego and an object as rectangles, at most $max metres, 0 if they overlap. One
-- hit per object; both timesteps are the moment of the smallest gap. Value is the gap, in m.
-- Source: the "distance to nearest object" of the Waymo Open Sim Agents metrics (Montali et al. 2023), without their
-- rounded corners.
-- max = 1.0
WITH gaps AS (
    SELECT
        scenario_id, track_id, ego_id, timestep,
        box_gap(ahead, "left", turn, ego_length, ego_width, length, width) AS gap
    FROM ego_pairs
    WHERE distance <= $max + reach
)
SELECT
    scenario_id,
    track_id,
    ego_id AS other_id,
    arg_min(timestep, (gap, timestep)) AS first_timestep,
    first_timestep AS last_timestep,
    min(gap) AS value
FROM gaps
GROUP BY scenario_id, track_id, ego_id
HAVING value <= $max
