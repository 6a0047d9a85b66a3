-- soft: Recorded velocity is the change of position over time: within 0.5 m/s for half of the steps of moving objects, within 5 m/s for 99 of 100.
WITH errors AS (
    SELECT scenario_id, sqrt((vx - dx / seconds) ** 2 + (vy - dy / seconds) ** 2) AS error
    FROM steps
    WHERE is_inner AND vx * vx + vy * vy > 0.01  -- runs of timesteps begin and end with noise
)
SELECT
    scenario_id,
    printf('median %.1f m/s, 99 %% below %.1f m/s', median(error), quantile_cont(error, 0.99)) AS detail
FROM errors
GROUP BY scenario_id
HAVING count_if(error > 0.5) > 0.5 * count(*) OR count_if(error > 5) > 0.01 * count(*);
