-- Each round takes one scenario of each value of {stratum}: equal numbers of all values, until one is used up.
SELECT *, row_number() OVER (PARTITION BY stratum ORDER BY priority, scenario_id) AS round
FROM ({priorities})
