-- Kept moments of a name that satisfy every condition over `moments` and `metadata`, ranked: in the order of scenarios
-- and time unless another is asked for. `made_id` is the scenario that is cut out of each.
WITH listed AS (
    SELECT
        * EXCLUDE (place),
        row_number() OVER (
            ORDER BY place, first_timestep, last_timestep, definition, track_id, other_id
        ) AS place
    FROM (SELECT * FROM moments WHERE name = $moments)
    JOIN {pool} AS metadata USING (scenario_id, content_hash, ego_id)
)
SELECT
    scenario_id, split, definition, first_timestep, last_timestep, track_id, other_id, value,
    row_number() OVER (ORDER BY {ranking}) AS rank,
    -- as make_scenario_id quotes it
    concat(
        'moment/', $moments, '/', replace(url_encode(scenario_id), '~', '%7E'), '@',
        left(md5(concat_ws(
            '|', content_hash, definition, first_timestep, last_timestep, coalesce(track_id, ''),
            coalesce(other_id, ''), $ego, $margin
        )), 12)
    ) AS made_id
FROM listed
WHERE {conditions}
QUALIFY rank <= {limit}
