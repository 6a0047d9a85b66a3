-- Scenarios of the same recording that overlap in time.
WITH windows AS (
    SELECT parent, scenario_id, dataset || '/' || source_log AS log, start_time, start_time + duration AS end_time
    FROM {scenarios}
    WHERE source_log IS NOT NULL AND start_time IS NOT NULL
)
SELECT DISTINCT unnest([0, 1]) AS parent, unnest([a.scenario_id, b.scenario_id]) AS scenario_id, log AS key
FROM (FROM windows WHERE parent = 0) AS a
JOIN (FROM windows WHERE parent = 1) AS b USING (log)
WHERE a.scenario_id <> b.scenario_id AND a.start_time < b.end_time AND b.start_time < a.end_time
