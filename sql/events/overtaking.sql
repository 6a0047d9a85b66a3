-- One vehicle overtakes another, the ego being one of them: first it is completely behind the other, then
-- completely ahead, passing at most $max_side metres to the side, both faster than $min_speed m/s in the same direction
-- (within 30 degrees). Lasts from its last timestep behind to its first ahead; value is that time, in s.
-- Source: an accelerative or flying overtaking (Wilson and Best 1982, "Driving strategies in overtaking"), without
-- requiring a return to the lane, so passing in a separate lane counts.
-- max_side = 6.0
-- min_speed = 2.0
WITH beside AS (
    SELECT
        scenario_id, track_id, ego_id, timestep, seconds,
        (CASE
            WHEN ahead >= (length + ego_length) / 2 THEN 1
            WHEN ahead <= -(length + ego_length) / 2 THEN -1
            ELSE 0
        END) AS place  -- of the object: clear ahead of the ego, clear behind, or beside
    FROM ego_pairs
    WHERE
        object_type IN ('VEHICLE', 'CYCLIST') AND abs("left") <= $max_side AND abs(turn) <= pi() / 6
        AND least(speed, ego_speed) > $min_speed AND abs(ahead) <= 50
),
clear AS (
    SELECT
        *,
        lead(place) OVER later AS next_place,
        lead(timestep) OVER later AS next_timestep,
        lead(seconds) OVER later AS next_seconds
    FROM beside
    WHERE place <> 0
    WINDOW later AS (PARTITION BY scenario_id, track_id ORDER BY timestep)
),
passes AS (
    SELECT c.*, count(b.timestep) AS num_beside
    FROM clear AS c LEFT JOIN beside AS b
        ON b.scenario_id = c.scenario_id AND b.track_id = c.track_id
        AND b.timestep > c.timestep AND b.timestep < c.next_timestep
    WHERE c.next_place = -c.place
    GROUP BY ALL
)
SELECT
    scenario_id,
    CASE WHEN place < 0 THEN track_id ELSE ego_id END AS track_id,
    CASE WHEN place < 0 THEN ego_id ELSE track_id END AS other_id,
    timestep AS first_timestep,
    next_timestep AS last_timestep,
    next_seconds - seconds AS value
FROM passes
WHERE num_beside = next_timestep - timestep - 1  -- observed at every timestep in between
