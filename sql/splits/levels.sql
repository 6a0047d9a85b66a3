-- A share of [0, 1) for each scenario: its place in the order of {along}. Parts are equal to one scenario.
SELECT
    scenario_id, weight, content_hash, place,
    (row_number() OVER (ORDER BY "{along}", scenario_id) - 1) / count(*) OVER () AS share
FROM {pool}
