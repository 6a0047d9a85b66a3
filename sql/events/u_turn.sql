-- A vehicle or cyclist turns by $min to $max degrees in one go, to either side (view turns). Of the ego alone with
-- ego_only=true. Value is the angle, in degrees.
-- Source: the U-turns of the Waymo Open Motion trajectory types (Ettinger et al. 2021), told by the angle here.
-- min = 135.0
-- max = 225.0
-- ego_only = false
SELECT scenario_id, track_id, NULL::VARCHAR AS other_id, first_timestep, last_timestep, degrees(abs(angle)) AS value
FROM turns
WHERE degrees(abs(angle)) >= $min AND degrees(abs(angle)) < $max AND (is_ego OR NOT $ego_only)
