-- A vehicle or cyclist turns left by $min to $max degrees in one turn (view turns); bends of the road count, too.
-- ego_only=true considers only the ego. Value is the angle, in degrees.
-- Source: the left turn of the Waymo Open Motion trajectory types (Ettinger et al. 2021: more than 30 degrees to the
-- left and not a U-turn), with 45 degrees, measured on the turn and not on the whole trajectory.
-- min = 45.0
-- max = 135.0
-- ego_only = false
SELECT scenario_id, track_id, NULL::VARCHAR AS other_id, first_timestep, last_timestep, degrees(angle) AS value
FROM turns
WHERE degrees(angle) >= $min AND degrees(angle) < $max AND (is_ego OR NOT $ego_only)
