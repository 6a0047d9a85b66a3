-- Scenarios cut from the same recording: the same ego, the same hour, the same streets.
SELECT parent, scenario_id, dataset || '/' || source_log AS key
FROM {scenarios}
WHERE source_log IS NOT NULL
