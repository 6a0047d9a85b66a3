-- needs: tracks
-- One row per object: how long it was observed, distance travelled, mean and maximum speed; for queries that name one of
-- them, with the columns of track_lanes: the lane on which it is longest.
CREATE VIEW objects AS
WITH kept AS (
    -- Unobserved steps inside the span hold 0: omit them before measuring.
    SELECT
        *,
        list_filter(range(1, len(x) + 1), lambda i: valid IS NULL OR valid[i]) AS seen
    FROM tracks
),
measured AS (
    SELECT
        scenario_id,
        track_id,
        track_index,
        object_type,
        source_type,
        start AS first_timestep,
        (start + len(x) - 1)::INTEGER AS last_timestep,
        len(seen)::INTEGER AS num_states,
        coalesce(
            list_sum(
                list_transform(
                    range(1, len(seen)),
                    lambda k: sqrt(
                        (x[seen[k + 1]] - x[seen[k]]) ** 2 + (y[seen[k + 1]] - y[seen[k]]) ** 2
                    )
                )
            ),
            0
        ) AS distance,
        list_avg(list_transform(seen, lambda i: sqrt(vx[i] ** 2 + vy[i] ** 2))) AS mean_speed,
        list_max(list_transform(seen, lambda i: sqrt(vx[i] ** 2 + vy[i] ** 2))) AS max_speed,
        length[1] AS length,
        width[1] AS width,
        height[1] AS height
    FROM kept
)
SELECT * FROM measured {lanes};
