-- soft: No object moves between two timesteps faster than the dataset's budget allows.
SELECT
    scenario_id,
    printf('track %s at %.0f m/s, timestep %d', arg_max(track_id, speed), max(speed), arg_max(timestep, speed)) AS detail
FROM (SELECT *, sqrt(dx * dx + dy * dy) / seconds AS speed FROM steps)
JOIN metadata_rows USING (scenario_id)
JOIN budgets USING (dataset)
WHERE speed > step_speed
GROUP BY scenario_id;
