-- An object and the ego pass the same area one after the other within $max seconds: from when the rear of the first
-- leaves the area that both sweep until the front of the second enters it; 0 if both are in it at once. The paths cross
-- at an angle of at least $min_angle degrees. Lasts from the first in the middle of the area to the second; value in s.
-- Source: Allen, Shin and Cooper 1978, "Analysis of traffic conflicts and collisions"; 5 s is the limit of a conflict
-- in FHWA-HRT-08-051 (SSAM).
-- max = 5.0
-- min_angle = 20.0
WITH crossings AS (
    SELECT
        o.*,
        b.left / (b.left - o.left) AS share,
        b.seconds + share * (o.seconds - b.seconds) AS object_at,
        b.ego_passes + share * (o.ego_passes - b.ego_passes) AS ego_at,
        abs(sin(o.turn)) AS sine,
        abs(cos(o.turn)) AS cosine
    FROM ego_corridor AS o JOIN ego_corridor AS b USING (scenario_id, track_id)
    WHERE
        b.timestep = o.timestep - 1 AND sign(b.left) <> sign(o.left) AND b.left <> o.left
        AND sine >= sin(radians($min_angle)) AND o.speed > 0.1 AND o.ego_passing_speed > 0.1
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
