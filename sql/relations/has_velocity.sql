-- An object moves at $min_velocity to $max_velocity m/s; stationary objects are left out.
-- min_velocity = 0.5
-- max_velocity = Infinity
SELECT scenario_id, track_id, timestep
FROM smoothed
WHERE speed BETWEEN $min_velocity AND $max_velocity AND extent >= 3
