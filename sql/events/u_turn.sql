-- A vehicle or cyclist turns by $min to $max degrees in one turn, to either side (view turns); ego_only=true considers
-- only the ego. Value is the angle, in degrees.
-- Source: the U-turns of the Waymo Open Motion trajectory types (Ettinger et al. 2021), here defined by the angle.
-- min = 135.0
-- max = 225.0
-- ego_only = false
SELECT scenario_id, track_id, NULL::VARCHAR AS other_id, first_timestep, last_timestep, degrees(abs(angle)) AS value
FROM turns
WHERE degrees(abs(angle)) >= $min AND degrees(abs(angle)) < $max AND (is_ego OR NOT $ego_only)
