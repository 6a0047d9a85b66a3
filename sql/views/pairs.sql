-- needs: smoothed, wrap_angle
-- One row per object, other object and timestep at which both were observed: the other in the frame of the object.
-- `ahead` and `left` [m] are the smoothed centre of the other, `box_ahead`, `box_left` and `turn` its box as recorded
-- (the arguments of box_gap), `distance` is between the centres of the boxes; columns that begin with `other_` are
-- the other's.
CREATE VIEW pairs AS
SELECT
    scenario_id,
    t.track_id,
    o.track_id AS other_id,
    timestep,
    sqrt((o.box_x - t.box_x) * (o.box_x - t.box_x) + (o.box_y - t.box_y) * (o.box_y - t.box_y)) AS distance,
    (o.x - t.box_x) * t.heading_x + (o.y - t.box_y) * t.heading_y AS ahead,
    (o.y - t.box_y) * t.heading_x - (o.x - t.box_x) * t.heading_y AS "left",
    (o.box_x - t.box_x) * t.heading_x + (o.box_y - t.box_y) * t.heading_y AS box_ahead,
    (o.box_y - t.box_y) * t.heading_x - (o.box_x - t.box_x) * t.heading_y AS box_left,
    wrap_angle(o.heading - t.heading) AS turn,
    t.heading,
    t.heading_x,
    t.heading_y,
    o.heading AS other_heading,
    t.speed,
    t.course,
    o.speed AS other_speed,
    o.course AS other_course,
    t.vx,
    t.vy,
    o.vx AS other_vx,
    o.vy AS other_vy,
    t.object_type,
    o.object_type AS other_object_type,
    t.length,
    t.width,
    o.length AS other_length,
    o.width AS other_width,
    t.radius,
    o.radius AS other_radius
FROM smoothed AS t JOIN smoothed AS o USING (scenario_id, timestep)
WHERE t.track_id <> o.track_id;
