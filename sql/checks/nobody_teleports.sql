-- soft: No object moves faster than 60 m/s between two timesteps.
SELECT
    scenario_id,
    printf('track %s at %.0f m/s, timestep %d', arg_max(track_id, speed), max(speed), arg_max(timestep, speed)) AS detail
FROM (SELECT *, sqrt(dx * dx + dy * dy) / seconds AS speed FROM steps)
WHERE speed > 60
GROUP BY scenario_id;
