-- The other crosses the line that runs from the middle of an object's side ($direction forward, backward, left,
-- right) outwards, at most $forward_thresh metres from its box: as long as it moves across at more than 0.2 m/s and
-- is less than $lateral_thresh metres beyond the line. `in_direction` is the other's, seen from above around the
-- object: clockwise, counterclockwise or either.
-- direction = "forward"
-- in_direction = "either"
-- forward_thresh = 10.0
-- lateral_thresh = 5.0
WITH axes AS (
    SELECT * FROM (VALUES ('forward', 1, 0), ('left', 0, 1), ('backward', -1, 0), ('right', 0, -1)) AS axes (name, c, s)
    WHERE CASE WHEN $direction IN ('forward', 'left', 'backward', 'right') THEN name = $direction
        ELSE error('direction: wanted forward, backward, left or right, found ' || $direction)
    END
),
aside AS MATERIALIZED (
    SELECT
        scenario_id, track_id, other_id, timestep, length, width,
        ahead * c + "left" * s AS away, "left" * c - ahead * s AS across,
        (other_vy * cos(heading) - other_vx * sin(heading)) * c
            - (other_vx * cos(heading) + other_vy * sin(heading)) * s AS rate
    FROM pairs, axes
),
sides AS (
    SELECT *, lag(across) OVER track AS before, row_number() OVER track AS i
    FROM aside
    SEMI JOIN (  -- pairs that come near the line at all
        FROM aside
        WHERE away BETWEEN length / 2 AND length / 2 + $forward_thresh AND abs(across) < width / 2 + 10
    ) AS near USING (scenario_id, track_id, other_id)
    CROSS JOIN (SELECT unnest([1, -1]) AS side)
    WHERE CASE $in_direction
        WHEN 'either' THEN true
        WHEN 'counterclockwise' THEN side = 1
        WHEN 'clockwise' THEN side = -1
        ELSE error('in_direction: wanted clockwise, counterclockwise or either, found ' || $in_direction)
    END
    WINDOW track AS (PARTITION BY scenario_id, track_id, other_id, side ORDER BY timestep)
),
runs AS (
    SELECT
        *,
        side * across < $lateral_thresh AND side * rate > 0.2 AS crosses,
        i - row_number() OVER (PARTITION BY scenario_id, track_id, other_id, side, crosses ORDER BY timestep) AS run,
        side * (across - before) > 0 AND abs(rate) > 0.2 AND away BETWEEN length / 2 AND length / 2 + $forward_thresh
            AND (
                (before < -width / 2) <> (across < -width / 2) OR (before > width / 2) <> (across > width / 2)
            ) AS is_here
    FROM sides
)
SELECT DISTINCT scenario_id, track_id, other_id, timestep
FROM (
    SELECT *, bool_or(is_here OR is_next) OVER (PARTITION BY scenario_id, track_id, other_id, side, run) AS is_crossing
    FROM (
        SELECT
            *,
            coalesce(
                lead(is_here) OVER (PARTITION BY scenario_id, track_id, other_id, side ORDER BY timestep), false
            ) AS is_next
        FROM runs
    )
    WHERE crosses
)
WHERE is_crossing
