-- hard: The ego is one of the tracks and is observed at the current timestep.
WITH egos AS (
    SELECT m.scenario_id, ego_id, current_timestep, track_id, x, valid, current_timestep - start + 1 AS i
    FROM metadata_rows AS m
    LEFT JOIN tracks AS t ON t.scenario_id = m.scenario_id AND track_id = ego_id
)
SELECT
    scenario_id,
    CASE
        WHEN track_id IS NULL THEN 'no track ' || ego_id
        ELSE 'track ' || ego_id || ' is not valid at timestep ' || current_timestep
    END AS detail
FROM egos
WHERE track_id IS NULL OR i NOT BETWEEN 1 AND len(x) OR NOT coalesce(valid[i], true);
