-- needs: object_states, ego_states, wrap_angle
-- One row per object and timestep at which it and the ego were observed: the object in the ego frame. `ahead`, `left`
-- [m], `v_ahead`, `v_left` [m/s] and `turn` [rad] are the object's centre, velocity and heading relative to the ego's;
-- they are the arguments of box_gap and box_ttc. `reach` [m] is the distance between the centres at which the circles
-- around the boxes touch.
-- kept: events read it again and again
CREATE VIEW ego_pairs AS
SELECT
    scenario_id,
    track_id,
    object_type,
    ego_id,
    timestep,
    seconds,
    sqrt(dx * dx + dy * dy) AS distance,
    dx * heading_x + dy * heading_y AS ahead,
    dy * heading_x - dx * heading_y AS "left",
    wrap_angle(turn) AS turn,
    dvx * heading_x + dvy * heading_y AS v_ahead,
    dvy * heading_x - dvx * heading_y AS v_left,
    speed,
    ego_speed,
    length,
    width,
    ego_length,
    ego_width,
    radius + sqrt(length::DOUBLE * length + width::DOUBLE * width) / 2 AS reach
FROM (
    SELECT
        scenario_id, o.track_id, o.object_type, e.track_id AS ego_id, timestep, e.seconds,
        (o.x - e.x)::DOUBLE AS dx, (o.y - e.y)::DOUBLE AS dy,
        (o.vx - e.vx)::DOUBLE AS dvx, (o.vy - e.vy)::DOUBLE AS dvy,
        o.heading - e.heading AS turn, heading_x, heading_y,
        o.speed, e.speed AS ego_speed, o.length, o.width, e.length AS ego_length, e.width AS ego_width, radius
    FROM object_states AS o JOIN (
        SELECT
            *, cos(heading) AS heading_x, sin(heading) AS heading_y,
            sqrt(length::DOUBLE * length + width::DOUBLE * width) / 2 AS radius
        FROM ego_states
    ) AS e USING (scenario_id, timestep)
    WHERE o.track_id <> e.track_id
);
