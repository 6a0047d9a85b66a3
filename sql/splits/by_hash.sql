-- A share of [0, 1) for each scenario, from the MD5 of seed and group: the same on every machine and engine.
-- All scenarios of a group ({by}; the scenario itself where that is null) get the same share.
SELECT scenario_id, weight, content_hash, place, {drawn_group} AS share
FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS split_group FROM {pool})
