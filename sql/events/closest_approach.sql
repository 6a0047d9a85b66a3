-- Smallest distance between the centres of the ego and an object, at most $max metres. One hit per object; both
-- timesteps are the moment of closest approach. Value is the distance, in m.
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
