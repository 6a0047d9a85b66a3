-- How the parameters are distributed: quantiles.
SELECT
    definition, parameter, count(*) AS known, min(v) AS least, quantile_cont(v, 0.05) AS q05,
    quantile_cont(v, 0.25) AS q25, quantile_cont(v, 0.5) AS median, quantile_cont(v, 0.75) AS q75,
    quantile_cont(v, 0.95) AS q95, max(v) AS most
FROM (
    UNPIVOT disturbances
    ON ego_speed, speed, gap, lateral_speed, rate, revealed_gap, revealed_speed
    INTO NAME parameter VALUE v
)
GROUP BY definition, parameter
ORDER BY definition, list_position(
    ['ego_speed', 'speed', 'gap', 'lateral_speed', 'rate', 'revealed_gap', 'revealed_speed'], parameter
)
