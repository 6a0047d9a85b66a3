-- A value in [0, 1) for each scenario, from the MD5 of seed and group: identical on every machine and engine.
-- All scenarios of a group ({by}; the scenario itself if that is null) have the same value.
SELECT scenario_id, weight, content_hash, place, {drawn_kin} AS share
FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS kin FROM {pool})
