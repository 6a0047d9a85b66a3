-- A value in [0, 1) for each scenario: its rank by {along}. Sizes of parts differ by at most one scenario.
SELECT
    scenario_id, weight, content_hash, place,
    (row_number() OVER (ORDER BY "{along}", scenario_id) - 1) / count(*) OVER () AS share
FROM {pool}
