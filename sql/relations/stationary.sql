-- An object moves less than $max_extent metres during the whole time it is observed, as parked vehicles do.
-- max_extent = 3.0
SELECT scenario_id, track_id, timestep
FROM smoothed
WHERE extent < $max_extent
