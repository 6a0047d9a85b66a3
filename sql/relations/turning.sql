-- An object turns left or right (direction "either": one of them): its heading changes to one side without a break,
-- by more than 45 degrees in all; or by more than 15, at 5 degrees/s on average, if its track begins or ends in the
-- turn.
-- direction = "either"
SELECT scenario_id, track_id, timestep
FROM turning_steps
WHERE CASE $direction
    WHEN 'either' THEN true
    WHEN 'left' THEN side = 1
    WHEN 'right' THEN side = -1
    ELSE error('direction: wanted left, right or either, found ' || $direction)
END
