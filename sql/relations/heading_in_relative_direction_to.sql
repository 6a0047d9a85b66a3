-- An object and the other move in the same direction (up to 45 degrees apart), in opposite directions (135 degrees and
-- more), or perpendicular to each other. One that is slower than 1 m/s and can move by itself (a vehicle, pedestrian or
-- cyclist) moves where it points, if the other one moves.
-- direction = "same"
WITH courses AS (
    SELECT
        *,
        speed < 1 AND other_speed > 1 AND object_type IN ('VEHICLE', 'PEDESTRIAN', 'CYCLIST') AS is_waiting,
        NOT is_waiting AND other_speed < 1 AND speed > 0.5
            AND other_object_type IN ('VEHICLE', 'PEDESTRIAN', 'CYCLIST') AS is_other_waiting
    FROM pairs  -- each pair
),
angles AS (
    SELECT
        scenario_id, track_id, other_id, timestep,
        abs(degrees(wrap_angle(
            CASE WHEN is_waiting THEN heading ELSE course END
            - CASE WHEN is_other_waiting THEN other_heading ELSE other_course END
        ))) AS angle
    FROM courses
    WHERE is_waiting OR is_other_waiting OR (speed >= 1 AND other_speed >= 1)
)
SELECT scenario_id, track_id, other_id, timestep
FROM angles
WHERE CASE $direction
    WHEN 'same' THEN angle <= 45
    WHEN 'opposite' THEN angle >= 135
    WHEN 'perpendicular' THEN angle > 45 AND angle < 135
    ELSE error('direction: wanted same, opposite or perpendicular, found ' || $direction)
END
