-- Order that takes one scenario of each value of {stratum} in rounds, so that values are drawn equally often.
SELECT *, row_number() OVER (PARTITION BY stratum ORDER BY luck, scenario_id) AS turn
FROM ({lucky})
