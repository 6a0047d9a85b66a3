-- A share for each scenario, the MD5 of seed and group in hexadecimal: the same on every machine and engine.
-- Bounds are texts, too: comparing numbers would take half as long again.
-- All scenarios of a group ({by}; the scenario itself where that is null) get the same share.
SELECT scenario_id, weight, content_hash, place, md5(concat($seed, ':', split_group)) AS share
FROM (SELECT *, coalesce("{by}"::VARCHAR, scenario_id) AS split_group FROM {pool})
