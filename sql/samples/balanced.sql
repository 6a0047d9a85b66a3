-- Turns one after the other from each value of {stratum}: of every value as many, while it has any.
SELECT *, row_number() OVER (PARTITION BY stratum ORDER BY luck, scenario_id) AS turn
FROM ({lucky})
