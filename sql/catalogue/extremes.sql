-- The three with the least time: cut-in, deceleration and acceleration until the gap is closed at the speeds of then
-- (decelerating vehicles: at the strongest rate, with the ego going on), cut-out until the ego is at what is revealed.
WITH timed AS (
    SELECT
        *,
        CASE definition
            WHEN 'cut_in' THEN gap / nullif(greatest(ego_speed - speed, 0), 0)
            WHEN 'cut_out' THEN (gap + revealed_gap) / nullif(greatest(ego_speed - revealed_speed, 0), 0)
            WHEN 'acceleration' THEN gap / nullif(greatest(speed - ego_speed, 0), 0)
            ELSE (sqrt((ego_speed - speed) ** 2 + 2 * rate * gap) - (ego_speed - speed)) / rate
        END AS time
    FROM disturbances
)
SELECT
    definition, time, scenario_id, track_id, first_timestep, ego_speed, speed, gap, lateral_speed, rate, revealed_gap
FROM timed
WHERE time IS NOT NULL
QUALIFY row_number() OVER (PARTITION BY definition ORDER BY time, scenario_id, track_id) <= 3
ORDER BY definition, time
