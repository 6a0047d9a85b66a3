-- soft: Recorded velocities (not those that the converter estimated) agree with the change of position: median and 99th percentile of the difference for moving objects are within the dataset's budgets.
WITH errors AS (
    SELECT
        scenario_id,
        velocity_median,
        velocity_p99,
        sqrt((vx - dx / seconds) ** 2 + (vy - dy / seconds) ** 2) AS error
    FROM steps JOIN metadata_rows USING (scenario_id) JOIN budgets USING (dataset)
    WHERE is_inner AND NOT is_velocity_estimated AND vx * vx + vy * vy > 0.01  -- the first and last steps of a track are noisy
)
SELECT
    scenario_id,
    printf(
        '%.1f %% of %d steps are off by more than %g m/s, %.1f %% by more than %g m/s',
        100.0 * count_if(error > velocity_median) / count(*), count(*), velocity_median,
        100.0 * count_if(error > velocity_p99) / count(*), velocity_p99
    ) AS detail
FROM errors
GROUP BY scenario_id, velocity_median, velocity_p99
HAVING count_if(error > velocity_median) > 0.5 * count(*) OR count_if(error > velocity_p99) > 0.01 * count(*);
