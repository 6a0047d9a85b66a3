-- Source logs with scenarios in more than one part of a split.
SELECT dataset, source_log, count(*) AS num_scenarios
FROM {drawn}
WHERE part > 0 AND source_log IS NOT NULL
GROUP BY dataset, source_log
HAVING min(part) <> max(part)
ORDER BY num_scenarios DESC, source_log
