-- What may have been a disturbance and was not counted, by reason.
SELECT reason, count(*) AS number
FROM (
    SELECT
        CASE
            WHEN next_timestep IS NULL THEN 'a vehicle on its way into the lane was not observed any more'
            WHEN next_timestep > timestep + 1
                THEN 'a vehicle was not observed while it came into the lane or left it'
            ELSE 'a vehicle came into the lane or left it beyond the place where the recording of the ego ends'
        END AS reason
    FROM (
        SELECT
            near_side, timestep, ahead, ego_passes,
            lead(timestep) OVER track AS next_timestep,
            lead(near_side) OVER track AS next_side,
            lead(abs(aside)) OVER track AS next_aside,
            abs(aside) AS distance
        FROM corridor_steps
        WINDOW track AS (PARTITION BY scenario_id, track_id ORDER BY timestep)
    )
    WHERE
        ahead > 0 AND (
            (next_timestep > timestep + 1 OR ego_passes IS NULL) AND (near_side <= 1.45) <> (next_side <= 1.45)
            OR next_timestep IS NULL AND near_side <= 1.45 AND distance > 0.9
        )
)
GROUP BY reason
UNION ALL
SELECT 'timesteps of 0.25 s and more: smoothing over half a second has no effect', count(*)
FROM metadata WHERE dt >= 0.25 HAVING count(*) > 0
ORDER BY reason
