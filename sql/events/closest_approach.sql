-- How close the ego and an object come: the smallest distance between their centres, at most $max metres. One hit per
-- object; both timesteps are when they are closest; value in m.
-- Source: the distance at closest point of approach (DCPA) of collision avoidance at sea and in the air.
-- max = 20.0
SELECT
    scenario_id,
    track_id,
    ego_id AS other_id,
    arg_min(timestep, (distance, timestep)) AS first_timestep,
    first_timestep AS last_timestep,
    min(distance) AS value
FROM ego_pairs
WHERE distance <= $max
GROUP BY scenario_id, track_id, ego_id
