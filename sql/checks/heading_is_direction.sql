-- soft: Vehicles and cyclists faster than 1 m/s move along their heading: the 99th percentile is within the dataset's budget; reversing is ignored.
WITH turns AS (
    SELECT
        scenario_id,
        heading_p99,
        abs((atan2(vy, vx) - heading + 5 * pi()) % (2 * pi()) - pi()) AS turn
    FROM object_states JOIN metadata_rows USING (scenario_id) JOIN budgets USING (dataset)
    WHERE speed > 1 AND object_type IN ('VEHICLE', 'CYCLIST')
)
SELECT
    scenario_id,
    printf('%d of %d states are off by more than %g rad', count_if(turn > heading_p99), count(*), heading_p99) AS detail
FROM turns
WHERE turn < 0.75 * pi()
GROUP BY scenario_id, heading_p99
HAVING count_if(turn > heading_p99) > 0.01 * count(*);
