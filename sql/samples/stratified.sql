-- Order in which the values of {stratum} are spread evenly, so that every prefix has the proportions of the whole.
SELECT *, (row_number() OVER (PARTITION BY stratum ORDER BY luck, scenario_id) - 1 + {drawn_stratum})
    / count(*) OVER (PARTITION BY stratum) AS turn
FROM ({lucky})
