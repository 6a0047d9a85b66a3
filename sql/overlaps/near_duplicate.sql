-- Scenarios with the same trajectory of the ego: equally many timesteps, and paths that differ by at most 0.1 m
-- everywhere after moving both to the same start. Egos that travel less than 5 m are ignored: all parked cars are
-- alike.
WITH drives AS (
    SELECT
        parent, scenario_id, ego_id, num_timesteps,
        floor(ego_distance / 0.2)::BIGINT AS distance_cell, floor(ego_max_speed / 0.2)::BIGINT AS speed_cell
    FROM {scenarios}
    WHERE ego_distance >= 5
),
probes AS (  -- values closer than a cell are in the same or a neighbouring cell
    SELECT * REPLACE (distance_cell + i AS distance_cell, speed_cell + j AS speed_cell)
    FROM drives, (SELECT unnest([-1, 0, 1]) AS i), (SELECT unnest([-1, 0, 1]) AS j)
    WHERE parent = 0
),
pairs AS MATERIALIZED (
    SELECT a.scenario_id AS id_a, a.ego_id AS ego_a, b.scenario_id AS id_b, b.ego_id AS ego_b
    FROM probes AS a JOIN (FROM drives WHERE parent = 1) AS b USING (num_timesteps, distance_cell, speed_cell)
    WHERE a.scenario_id <> b.scenario_id
),
paths AS (
    SELECT scenario_id, list_transform(x, lambda v: v - x[1]) AS x, list_transform(y, lambda v: v - y[1]) AS y
    FROM tracks
    WHERE (scenario_id, track_id) IN (SELECT (id_a, ego_a) FROM pairs UNION SELECT (id_b, ego_b) FROM pairs)
)
SELECT unnest([0, 1]) AS parent, unnest([id_a, id_b]) AS scenario_id, id_a AS key
FROM pairs JOIN paths AS a ON a.scenario_id = id_a JOIN paths AS b ON b.scenario_id = id_b
WHERE len(a.x) = len(b.x)
    AND list_max(list_transform(range(1, len(a.x) + 1), lambda k: greatest(abs(a.x[k] - b.x[k]), abs(a.y[k] - b.y[k]))))
        <= 0.1
