-- needs: ego_corridor
-- ego_corridor of vehicles that drive in about the ego's direction (45 degrees), smoothed: `aside` [m] to the left of the
-- ego's path, `gap` [m] from bumper to bumper along it, `speed` and `ego_speed` [m/s] are means over half a second.
-- `near_side` [m] is the distance of the side that is nearest to the path; `before` has the step before, if it was
-- observed.
-- kept: disturbances read it again and again
CREATE VIEW corridor_steps AS
SELECT
    *,
    CASE WHEN lag(timestep) OVER track = timestep - 1 THEN
        lag({'seconds': seconds, 'near_side': near_side, 'ahead': ahead, 'gap': gap, 'speed': speed, 'ego_speed': ego_speed}) OVER track
    END AS before
FROM (
    SELECT
        scenario_id, track_id, ego_id, timestep, seconds, "left", length, width, ego_length, ego_passes,
        avg("left") OVER near AS aside,
        avg(ahead) OVER near AS ahead,
        avg(speed) OVER near AS speed,
        avg(ego_speed) OVER near AS ego_speed,
        abs(aside) - width / 2 AS near_side,
        abs(ahead) - (length + ego_length) / 2 AS gap
    FROM (SELECT * REPLACE (ahead::DOUBLE AS ahead) FROM ego_corridor)
    WHERE object_type = 'VEHICLE' AND abs(turn) <= pi() / 4
    WINDOW near AS (
        PARTITION BY scenario_id, track_id ORDER BY seconds RANGE BETWEEN 0.26 PRECEDING AND 0.26 FOLLOWING
    )
)
WINDOW track AS (PARTITION BY scenario_id, track_id ORDER BY timestep);
