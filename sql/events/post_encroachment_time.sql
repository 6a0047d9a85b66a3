-- An object and the ego pass the same area one after the other within $max seconds: from when the rear of the first
-- leaves the area that both sweep until the front of the second enters it; 0 if both are in it at once. The paths cross
-- at an angle of at least $min_angle degrees. Lasts from the first in the middle of the area to the second; value in s.
-- Source: Allen, Shin and Cooper 1978, "Analysis of traffic conflicts and collisions"; 5 s is the limit of a conflict
-- in FHWA-HRT-08-051 (SSAM).
-- max = 5.0
-- min_angle = 20.0
WITH sides AS (
    SELECT
        *,
        lag("left") OVER earlier AS left_before,
        lag(seconds) OVER earlier AS seconds_before,
        lag(ego_passes) OVER earlier AS passes_before,
        lag(timestep) OVER earlier = timestep - 1 AS is_next
    FROM ego_corridor
    WINDOW earlier AS (PARTITION BY scenario_id, track_id ORDER BY timestep)
),
crossings AS (
    SELECT
        *,
        left_before / (left_before - "left") AS share,
        seconds_before + share * (seconds - seconds_before) AS object_at,
        passes_before + share * (ego_passes - passes_before) AS ego_at,
        abs(sin(turn)) AS sine,
        abs(cos(turn)) AS cosine
    FROM sides
    WHERE
        is_next AND sign(left_before) <> sign("left") AND left_before <> "left"
        AND sine >= sin(radians($min_angle)) AND speed > 0.1 AND ego_passing_speed > 0.1
),
areas AS (
    -- Half the length of the conflict area along each path, around the crossing point.
    SELECT
        *,
        (length / 2 + (ego_width + width * cosine) / (2 * sine)) / speed AS object_half,
        (ego_length / 2 + (width + ego_width * cosine) / (2 * sine)) / ego_passing_speed AS ego_half
    FROM crossings
),
times AS (
    SELECT *, greatest(abs(ego_at - object_at) - object_half - ego_half, 0) AS pet FROM areas
),
first_times AS (
    SELECT * FROM times
    WHERE pet <= $max
    QUALIFY row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY pet, timestep) = 1
)
SELECT
    f.scenario_id,
    f.track_id,
    f.ego_id AS other_id,
    min(e.timestep) AS first_timestep,
    max(e.timestep) AS last_timestep,
    any_value(pet) AS value
FROM first_times AS f JOIN ego_states AS e USING (scenario_id)
WHERE e.seconds BETWEEN least(object_at, ego_at) - 1e-6 AND greatest(object_at, ego_at) + 1e-6
GROUP BY f.scenario_id, f.track_id, f.ego_id
