-- lake: Each shard has as many scenarios as it says, and as many records in quarantine: what was read is one or the other.
WITH listed AS (
    SELECT *, concat_ws('/', 'shard ' || dataset, version, split, name) AS shard FROM shards WHERE split <> ''
),
held AS (
    SELECT file, count(*) AS num_scenarios FROM (SELECT tracks_file AS file FROM metadata_rows) GROUP BY file
),
converted AS (
    SELECT any_value(shard) AS shard, any_value(l.num_scenarios) AS said, coalesce(sum(h.num_scenarios), 0) AS found
    FROM (SELECT *, unnest(files) AS file FROM listed) AS l
    LEFT JOIN held AS h USING (file)
    GROUP BY key
),
rejected AS (
    -- Shards of one name, converted one after the other, cannot be told apart in quarantine.
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
