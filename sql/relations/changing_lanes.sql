-- An object changes to the lane on its left or right (direction "either": one of them) while it moves across at 0.1
-- m/s or more and within 60 degrees of the lane's direction: from where it began to drift to that side until it
-- stops. Steps at which it is turning are left out.
-- direction = "either"
WITH visited AS (
    SELECT scenario_id, track_id, dataset, version, map_id, lanes[lane].lane_id AS lane_id
    FROM (SELECT *, unnest(list_distinct(found.lane)) AS lane FROM walked_lanes)
),
beside AS (  -- tracks that are ever on two lanes beside each other
    SELECT DISTINCT t.scenario_id, t.track_id
    FROM visited AS t JOIN lane_outlines USING (dataset, version, map_id, lane_id)
    JOIN visited AS o ON o.scenario_id = t.scenario_id AND o.track_id = t.track_id
    WHERE list_contains(left_neighbors, o.lane_id) OR list_contains(right_neighbors, o.lane_id)
),
lanes AS MATERIALIZED (
    SELECT
        scenario_id, track_id, timestep, lane, lane_offset,
        row_number() OVER track AS i, lag(lane) OVER track AS previous
    FROM (
        SELECT
            scenario_id, track_id,
            unnest(timesteps) AS timestep, unnest(found.lane) AS lane, unnest(found.aside) AS lane_offset
        FROM walked_lanes SEMI JOIN beside USING (scenario_id, track_id)
    )
    WINDOW track AS (PARTITION BY scenario_id, track_id ORDER BY timestep)
),
changed AS (
    SELECT
        l.*, dataset, version, map_id, lanes[lane].lane_id AS lane_id, lanes[previous].lane_id AS previous_id
    FROM lanes AS l JOIN walked_lanes USING (scenario_id, track_id)
    WHERE lane <> previous
),
segments AS (  -- of the line of the lane before
    SELECT
        l.*, list_contains(left_neighbors, l.lane_id) AS is_left, vx, vy,
        unnest(range(1, len(line_xs))) AS k, line_xs[k + 1] - line_xs[k] AS dx, line_ys[k + 1] - line_ys[k] AS dy,
        x + origin_x - line_xs[k] AS ahead, y + origin_y - line_ys[k] AS aside
    FROM changed AS l JOIN lane_outlines AS p ON
        p.dataset = l.dataset AND p.version = l.version AND p.map_id = l.map_id AND p.lane_id = previous_id
    JOIN smoothed USING (scenario_id, track_id, timestep)
    JOIN (SELECT scenario_id, origin_x, origin_y FROM metadata_rows) USING (scenario_id)
    WHERE is_left OR list_contains(right_neighbors, l.lane_id)
),
crossings AS (
    SELECT scenario_id, track_id, i, CASE WHEN is_left THEN 1 ELSE -1 END AS side
    FROM (
        SELECT
            scenario_id, track_id, i, is_left, vx, vy,
            arg_min(
                atan2(dy, dx),
                (segment_gap(ahead, aside, dx, dy), (dx * aside - dy * ahead) / greatest(sqrt(dx ** 2 + dy ** 2), 1e-9))
            ) AS lane_course
        FROM segments
        GROUP BY ALL
    )
    WHERE
        abs(vy * cos(lane_course) - vx * sin(lane_course)) >= 0.1
        AND abs(cos(atan2(vy, vx) - lane_course)) >= 0.5
        AND CASE $direction
            WHEN 'either' THEN true
            WHEN 'left' THEN is_left
            WHEN 'right' THEN NOT is_left
            ELSE error('direction: wanted left, right or either, found ' || $direction)
        END
),
drifts AS (
    SELECT
        scenario_id, track_id, timestep, i, side,
        c.i IS NOT NULL AS is_crossing,
        is_crossing OR side * (lane_offset - lag(lane_offset) OVER track) > 0 AS drifts
    FROM lanes AS l
    JOIN (SELECT DISTINCT scenario_id, track_id, side FROM crossings) AS sides USING (scenario_id, track_id)
    LEFT JOIN crossings AS c USING (scenario_id, track_id, side, i)
    WINDOW track AS (PARTITION BY scenario_id, track_id, side ORDER BY i)
),
runs AS (
    SELECT
        *,
        sum((NOT coalesce(drifts, false))::INTEGER) OVER (PARTITION BY scenario_id, track_id, side ORDER BY i) AS run
    FROM drifts
)
SELECT DISTINCT scenario_id, track_id, timestep
FROM (SELECT *, bool_or(is_crossing) OVER (PARTITION BY scenario_id, track_id, side, run) AS is_change FROM runs)
ANTI JOIN turning_steps USING (scenario_id, track_id, timestep)
WHERE is_change
