-- How much of the grid of parameters has been seen: cells with an occurrence, cells with one only, and the share of further
-- occurrences that is expected to fall into cells without any (Good 1953, after Turing: cells with one by occurrences).
SELECT
    definition, sum(n)::BIGINT AS occurrences, count(*) AS cells, count(*) FILTER (n = 1) AS seen_once,
    count(*) FILTER (n = 1) / sum(n) AS unseen_mass
FROM (SELECT definition, cell, count(*) AS n FROM disturbances GROUP BY ALL)
GROUP BY definition
ORDER BY definition
