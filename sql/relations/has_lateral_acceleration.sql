-- An object accelerates across its heading by $min_accel to $max_accel m/s^2, positive to the left; stationary objects
-- are left out.
-- min_accel = -Infinity
-- max_accel = Infinity
SELECT scenario_id, track_id, timestep
FROM smoothed
WHERE accel_y * cos(heading) - accel_x * sin(heading) BETWEEN $min_accel AND $max_accel AND extent >= 3
