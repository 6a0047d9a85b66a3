-- needs: corridor_steps
-- One row per vehicle that comes into the ego's lane or leaves it, ahead of the ego: the lane is 3.5 m wide, around the
-- ego's path, and the vehicle's near side crosses the line 0.3 m inside of its marking. `direction` is -1 inward, 1
-- outward; `timestep` is the first beyond the line, `share` says how much of the time since the step before had passed
-- when it crossed, by a line fitted to its course within half a metre of there, or else by these two steps.
-- `middle` is the nearest timestep at which its centre is within 0.9 m of the path, at most 6 s after it came in, or
-- before it left. Only where the ego drives later: beyond the end of its recording its lane is not known. Then,
-- interpolated: `gap` [m], `speed`, `ego_speed` [m/s]. `lateral_speed` [m/s] is the slope of its distance from the path
-- between half a metre from its course outside and half a metre from the path.
-- kept: disturbances read it again and again
CREATE VIEW corridor_crossings AS
WITH crossings AS MATERIALIZED (
    SELECT
        *, sign(near_side - before.near_side)::INTEGER AS direction,
        (before.near_side - 1.45) / (before.near_side - near_side) AS share_between
    FROM corridor_steps
    WHERE (near_side <= 1.45) <> (before.near_side <= 1.45) AND ahead > 0 AND ego_passes IS NOT NULL
),
around AS MATERIALIZED (
    SELECT
        c.scenario_id, c.track_id, c.timestep AS crosses, c.direction,
        s.timestep, s.seconds, s.seconds - c.seconds AS later, s.left, sign(c.aside) * s.aside AS distance,
        sign(c.aside) * s.left - c.width / 2 - 1.45 AS beyond,
        (s.timestep >= c.timestep) = (c.direction < 0) AS is_inside
    FROM crossings AS c JOIN corridor_steps AS s USING (scenario_id, track_id)
    WHERE s.seconds BETWEEN c.seconds - 6 AND c.seconds + 6
),
outsides AS (
    SELECT *, max(distance) FILTER (NOT is_inside) OVER (PARTITION BY scenario_id, track_id, crosses) AS outside
    FROM around
),
ends AS (
    -- Of the steps inside the first, of those outside the last, seen in the direction of a vehicle that comes in.
    SELECT
        scenario_id, track_id, crosses, direction,
        -direction * min(-direction * timestep) FILTER (is_inside AND distance <= 0.9) AS middle,
        -direction * min(-direction * timestep) FILTER (is_inside AND distance <= 0.5) AS inner_end,
        -direction * max(-direction * timestep) FILTER (NOT is_inside AND distance >= outside - 0.5) AS outer_end
    FROM outsides
    GROUP BY scenario_id, track_id, crosses, direction
    HAVING middle IS NOT NULL
    -- Of several crossings around the same middle, the nearest.
    QUALIFY row_number() OVER (PARTITION BY scenario_id, track_id, direction, middle ORDER BY direction * crosses) = 1
),
slopes AS (
    SELECT
        scenario_id, track_id, crosses, abs(regr_slope("left", seconds)) AS lateral_speed,
        regr_intercept(later, beyond) FILTER (abs(beyond) <= 0.5) AS crosses_later
    FROM around JOIN ends USING (scenario_id, track_id, crosses)
    WHERE
        timestep BETWEEN least(outer_end, coalesce(inner_end, middle)) AND greatest(outer_end, coalesce(inner_end, middle))
    GROUP BY scenario_id, track_id, crosses
)
SELECT
    c.scenario_id, c.track_id, ego_id, c.timestep, c.seconds, c.direction, middle::INTEGER AS middle,
    c.ahead, c.length,
    1 + crosses_later / (c.seconds - before.seconds) AS share_fitted,
    -- A course that is fitted to more than this crossing is at the line at another time.
    CASE WHEN share_fitted BETWEEN -1 AND 2 THEN share_fitted ELSE share_between END AS share,
    before.gap + share * (gap - before.gap) AS gap,
    before.ahead + share * (ahead - before.ahead) AS crosses_ahead,
    before.speed + share * (speed - before.speed) AS speed,
    before.ego_speed + share * (ego_speed - before.ego_speed) AS ego_speed,
    lateral_speed
FROM crossings AS c
JOIN ends AS e ON e.scenario_id = c.scenario_id AND e.track_id = c.track_id AND e.crosses = c.timestep
LEFT JOIN slopes AS s ON s.scenario_id = c.scenario_id AND s.track_id = c.track_id AND s.crosses = c.timestep;
