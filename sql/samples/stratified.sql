-- Rounds spread evenly over each value of {stratum}: any number of scenarios has the proportions of the whole.
SELECT *, (row_number() OVER (PARTITION BY stratum ORDER BY priority, scenario_id) - 1 + {drawn_stratum})
    / count(*) OVER (PARTITION BY stratum) AS round
FROM ({priorities})
