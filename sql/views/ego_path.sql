-- needs: ego_progress, wrap_angle
-- The ego's recorded path as points about 2 m apart, extended straight by 50 m beyond the recording. `s` [m] is the
-- length of the path up to the point; `seconds` is the time at which the ego is there, null beyond the recording.
CREATE VIEW ego_path AS
WITH steps AS (
    SELECT
        scenario_id, s, x, y, heading, seconds, speed,
        coalesce(lead(s) OVER later - s, 0) AS d,
        coalesce(lead(x) OVER later - x, 0) AS dx,
        coalesce(lead(y) OVER later - y, 0) AS dy,
        coalesce(wrap_angle(lead(heading) OVER later - heading), 0) AS turn,
        coalesce(lead(seconds) OVER later - seconds, 0) AS duration,
        lead(s) OVER later IS NULL AS is_last
    FROM ego_progress
    WINDOW later AS (PARTITION BY scenario_id ORDER BY timestep)
),
sampled AS (
    SELECT *, unnest(range(greatest(ceil(d / 2), 1)::INTEGER)) / greatest(ceil(d / 2), 1) AS share FROM steps
),
recorded AS (
    -- Where the ego is slow, keep the first of the points within 2 m.
    SELECT
        scenario_id,
        min(s + share * d) AS s,
        arg_min({
            'x': x + share * dx,
            'y': y + share * dy,
            'heading': wrap_angle(heading + share * turn),
            'seconds': seconds + share * duration,
            'speed': speed
        }, s + share * d) AS point
    FROM sampled
    GROUP BY scenario_id, floor((s + share * d) / 2)
)
SELECT scenario_id, s, unnest(point) FROM recorded
UNION ALL
SELECT
    scenario_id,
    s + k AS s,
    x + k * cos(heading) AS x,
    y + k * sin(heading) AS y,
    heading,
    NULL AS seconds,
    NULL AS speed
FROM (SELECT *, unnest(range(2, 51, 2)) AS k FROM steps WHERE is_last);
