-- A share of [0, 1) for each scenario: its rank in the order of {along}. Sizes of parts differ by one scenario at most.
SELECT
    scenario_id, weight, content_hash, place,
    (row_number() OVER (ORDER BY "{along}", scenario_id) - 1) / count(*) OVER () AS share
FROM {pool}
