-- Scenarios of the database that break no rule, in its order.
WITH {rules}
SELECT scenario_id, weight, content_hash
FROM {pool}
ANTI JOIN broken USING (scenario_id)
ORDER BY place
