-- Each scenario's part: its value of {each}.
SELECT scenario_id, weight, content_hash, coalesce("{each}"::VARCHAR, 'none') AS part
FROM {pool}
ORDER BY place
