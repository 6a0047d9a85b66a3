-- A share of [0, 1) for each scenario: the fraction of scenarios with a smaller {along}. Equal values stay together.
SELECT
    scenario_id, weight, content_hash, place,
    (rank() OVER (ORDER BY "{along}") - 1) / count(*) OVER () AS share
FROM {pool}
