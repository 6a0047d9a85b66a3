-- The same content under another id, for example a recording converted twice as two versions.
SELECT parent, scenario_id, content_hash::VARCHAR AS key
FROM members
WHERE scenario_id NOT IN (SELECT scenario_id FROM members GROUP BY scenario_id HAVING min(parent) <> max(parent))
