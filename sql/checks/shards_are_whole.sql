-- lake: Each shard has the recorded number of scenarios and of quarantined records; every record read is one or the other.
WITH listed AS (
    SELECT
        *,
        concat_ws('/', 'shard ' || dataset, version, split, name) AS shard,
        -- Shards that were compacted together share files and cannot be distinguished.
        coalesce(nullif(regexp_extract(metadata_file, '-(training|analytics)-([0-9a-f]{16}).parquet$', 2), ''), key) AS unit
    FROM shards
    WHERE split <> ''
),
held AS (
    SELECT file, count(*) AS num_scenarios FROM (SELECT tracks_file AS file FROM metadata_rows) GROUP BY file
),
converted AS (
    SELECT min(shard) || if(count(*) = 1, '', ' and those with it') AS shard, sum(num_scenarios) AS said, found
    FROM listed
    JOIN (
        SELECT unit, coalesce(sum(num_scenarios), 0) AS found
        FROM (SELECT DISTINCT unit, unnest(files) AS file FROM listed)
        LEFT JOIN held USING (file)
        GROUP BY unit
    ) USING (unit)
    GROUP BY unit, found
),
rejected AS (
    -- Successive conversions of a shard of the same name cannot be distinguished in quarantine.
    SELECT shard, said, coalesce(found, 0) AS found
    FROM (SELECT shard, sum(num_quarantined) AS said FROM listed GROUP BY shard)
    LEFT JOIN (
        SELECT concat_ws('/', 'shard ' || dataset, version, split, shard) AS shard, count(*) AS found
        FROM quarantine
        GROUP BY ALL
    ) USING (shard)
)
SELECT NULL AS scenario_id, shard || ': ' || found || ' scenarios, ' || said || ' were converted' AS detail
FROM converted
WHERE said <> found
UNION ALL
SELECT NULL, shard || ': ' || found || ' records in quarantine, ' || said || ' were put there'
FROM rejected
WHERE said <> found;
