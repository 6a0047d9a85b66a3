-- needs: object_states, ego_states, wrap_angle
-- One row per object and timestep at which it and the ego were observed: the object in the ego frame. `ahead`, `left`
-- [m], `v_ahead`, `v_left` [m/s] and `turn` [rad] are the object's centre, velocity and heading relative to the ego's;
-- they are the arguments of box_gap and box_ttc.
CREATE VIEW ego_pairs AS
SELECT
    scenario_id,
    o.track_id,
    o.object_type,
    e.track_id AS ego_id,
    timestep,
    e.seconds,
    sqrt((o.x - e.x) ** 2 + (o.y - e.y) ** 2) AS distance,
    (o.x - e.x) * cos(e.heading) + (o.y - e.y) * sin(e.heading) AS ahead,
    (o.y - e.y) * cos(e.heading) - (o.x - e.x) * sin(e.heading) AS "left",
    wrap_angle(o.heading - e.heading) AS turn,
    (o.vx - e.vx) * cos(e.heading) + (o.vy - e.vy) * sin(e.heading) AS v_ahead,
    (o.vy - e.vy) * cos(e.heading) - (o.vx - e.vx) * sin(e.heading) AS v_left,
    o.speed,
    e.speed AS ego_speed,
    o.length,
    o.width,
    e.length AS ego_length,
    e.width AS ego_width
FROM object_states AS o JOIN ego_states AS e USING (scenario_id, timestep)
WHERE o.track_id <> e.track_id;
