-- Source logs with scenarios in more than one part of a split.
SELECT dataset, source_log, count(*) AS num_scenarios, count(DISTINCT part) AS num_parts
FROM drawn JOIN metadata_rows USING (scenario_id)
WHERE source_log IS NOT NULL
GROUP BY dataset, source_log
HAVING min(part) <> max(part)
ORDER BY num_scenarios DESC, source_log
