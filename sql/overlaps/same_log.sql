-- Scenarios cut from the same recording: same ego, time and place.
SELECT parent, scenario_id, dataset || '/' || source_log AS key
FROM {scenarios}
WHERE source_log IS NOT NULL
