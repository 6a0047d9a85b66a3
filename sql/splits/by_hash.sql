-- One number u in [0, 1) per scenario, from the MD5 of seed and group: the same on every machine and engine.
-- All scenarios of a group ({by}; the scenario itself where that is null) get the same number.
SELECT
    scenario_id,
    {weight} AS weight,
    content_hash,
    ('0x' || substr(md5($seed || ':' || coalesce("{by}"::VARCHAR, scenario_id)), 1, 13))::BIGINT
        / 4503599627370496.0 AS u
FROM {source}
ORDER BY {order}
