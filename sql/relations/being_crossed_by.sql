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
aside AS NOT MATERIALIZED (
    SELECT
        scenario_id, track_id, other_id, timestep, length, width,
        ahead * c + "left" * s AS away, "left" * c - ahead * s AS across,
        (other_vy * heading_x - other_vx * heading_y) * c
            - (other_vx * heading_x + other_vy * heading_y) * s AS rate
    FROM pairs, axes  -- twice, below: all pairs would take more memory than time
),
near AS (  -- pairs that come near the line at all
    SELECT * FROM aside
    SEMI JOIN (
        FROM aside
        WHERE away BETWEEN length / 2 AND length / 2 + $forward_thresh AND abs(across) < width / 2 + 10
    ) AS close USING (scenario_id, track_id, other_id)
),
steps AS (
    SELECT *, lag(across) OVER pair AS before, row_number() OVER pair AS i
    FROM near
    WINDOW pair AS (PARTITION BY scenario_id, track_id, other_id ORDER BY timestep)
),
sides AS (  -- 1 counterclockwise, -1 clockwise: to which it moves, and to which it has come across an edge of the box
    SELECT
        *,
        CASE WHEN abs(rate) > 0.2 AND sign(rate) * across < $lateral_thresh THEN sign(rate) ELSE 0 END AS side,
        CASE
            WHEN
                abs(rate) > 0.2 AND away BETWEEN length / 2 AND length / 2 + $forward_thresh AND (
                    (before < -width / 2) <> (across < -width / 2) OR (before > width / 2) <> (across > width / 2)
                )
                THEN sign(across - before)
            ELSE 0
        END AS crossed
    FROM steps
),
runs AS (
    SELECT
        *, lead(crossed) OVER (PARTITION BY scenario_id, track_id, other_id ORDER BY i) AS crosses,
        i - row_number() OVER (PARTITION BY scenario_id, track_id, other_id, side ORDER BY i) AS run
    FROM sides
)
SELECT scenario_id, track_id, other_id, timestep
FROM runs
WHERE CASE $in_direction
    WHEN 'either' THEN side <> 0
    WHEN 'counterclockwise' THEN side = 1
    WHEN 'clockwise' THEN side = -1
    ELSE error('in_direction: wanted clockwise, counterclockwise or either, found ' || $in_direction)
END
QUALIFY bool_or(side = crossed OR side = crosses) OVER (PARTITION BY scenario_id, track_id, other_id, side, run)
