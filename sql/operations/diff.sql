-- Scenarios that only one of two databases contains, or whose content differs between them.
SELECT
    coalesce(before.scenario_id, after.scenario_id) AS scenario_id,
    CASE
        WHEN before.scenario_id IS NULL THEN 'came'
        WHEN after.scenario_id IS NULL THEN 'went'
        ELSE 'changed'
    END AS what
FROM {before} AS before FULL JOIN {after} AS after ON before.scenario_id = after.scenario_id
WHERE before.content_hash IS DISTINCT FROM after.content_hash
ORDER BY scenario_id
