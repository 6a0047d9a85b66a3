-- The priority of each scenario; the smallest are drawn: -ln(u) / likelihood, with u from seed and id, samples without
-- replacement in proportion to the likelihood (Efraimidis and Spirakis, "Weighted random sampling with a reservoir",
-- Information Processing Letters 2006).
SELECT
    scenario_id, weight, content_hash, {place} AS place, {stratum} AS stratum,
    -ln(1 - {drawn_id}) / likelihood AS priority
FROM (SELECT *, ({likelihood})::DOUBLE AS likelihood FROM {pool} AS metadata)
WHERE likelihood > 0
