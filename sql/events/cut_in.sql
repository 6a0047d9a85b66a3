-- A vehicle moves into the ego's lane in front of it. At first its near side is outside the lane (3.5 m wide, around
-- the ego's own path), then 0.3 m inside, then its centre is within 0.9 m of the path, all within $within seconds. When
-- it enters, its rear is at most $max_gap metres ahead of the ego's front, both move faster than $min_speed m/s, and it
-- drives in the ego's direction. Lasts from entering until it is in the middle; value is the gap on entering, in m. A
-- lane change of the ego behind another vehicle has the same geometry and counts, too.
-- Source: UN Regulation 157 (ALKS), 5.2.5 and annex 4: a cut-in, with lane intrusion from 0.3 m beyond the marking.
-- max_gap = 30.0
-- min_speed = 2.0
-- within = 4.0
WITH sides AS (
    SELECT *, abs("left") - width / 2 AS near_side, ahead - (length + ego_length) / 2 AS gap
    FROM ego_corridor
    WHERE object_type = 'VEHICLE' AND abs(turn) <= pi() / 4
),
intrusions AS (
    SELECT o.*
    FROM sides AS o JOIN sides AS b USING (scenario_id, track_id)
    WHERE
        b.timestep = o.timestep - 1 AND o.near_side <= 1.45 AND b.near_side > 1.45
        AND o.gap BETWEEN 0 AND $max_gap AND least(o.speed, o.ego_speed) > $min_speed
),
middles AS (
    SELECT scenario_id, track_id, timestep, seconds FROM sides WHERE abs("left") <= 0.9 AND ahead > 0
)
SELECT
    i.scenario_id,
    i.track_id,
    i.ego_id AS other_id,
    i.timestep AS first_timestep,
    min(m.timestep) AS last_timestep,
    i.gap AS value
FROM intrusions AS i JOIN middles AS m USING (scenario_id, track_id)
WHERE m.timestep >= i.timestep AND m.seconds <= i.seconds + $within
GROUP BY i.scenario_id, i.track_id, i.ego_id, i.timestep, i.gap
-- Of several intrusions before it reaches the middle, take the last.
QUALIFY row_number() OVER (PARTITION BY i.scenario_id, i.track_id, last_timestep ORDER BY i.timestep DESC) = 1
