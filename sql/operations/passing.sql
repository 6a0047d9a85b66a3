-- Scenarios of the pool that violate no rule, in its order.
WITH {rules}
SELECT scenario_id, weight, content_hash
FROM {pool}
ANTI JOIN broken USING (scenario_id)
ORDER BY place
