-- soft: Vehicles and cyclists above 1 m/s go where they point, within 1 rad for 99 of 100 states; reversing is left out.
WITH turns AS (
    SELECT scenario_id, abs((atan2(vy, vx) - heading + 5 * pi()) % (2 * pi()) - pi()) AS turn
    FROM states
    WHERE speed > 1 AND object_type IN ('VEHICLE', 'CYCLIST')
)
SELECT scenario_id, printf('%d of %d states are off by more than 1 rad', count_if(turn > 1), count(*)) AS detail
FROM turns
WHERE turn < 0.75 * pi()
GROUP BY scenario_id
HAVING count_if(turn > 1) > 0.01 * count(*);
