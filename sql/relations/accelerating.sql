-- An object accelerates along its heading by $min_accel to $max_accel m/s^2, negative to brake; stationary objects are
-- left out.
-- min_accel = 0.65
-- max_accel = Infinity
SELECT scenario_id, track_id, timestep
FROM smoothed
WHERE accel_x * cos(heading) + accel_y * sin(heading) BETWEEN $min_accel AND $max_accel AND extent >= 3
