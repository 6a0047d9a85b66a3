-- needs: object_lanes, source_places, lane_outlines, nearest_segment
-- One row per object and timestep at which it is on a lane (see object_lanes): `lane_id`, `lane_type`, and `lane_offset`
-- [m], how far the middle of its box is to the left of the lane's. Queries of `states` that name one of the three get
-- them there.
CREATE VIEW state_lanes AS
SELECT
    o.scenario_id, o.track_id, o.timestep, o.lane_id, o.lane_type,
    nearest_segment(s.box_px, s.box_py, l.line_xs, l.line_ys).aside AS lane_offset
FROM object_lanes AS o JOIN source_places AS s USING (scenario_id, track_id, timestep) JOIN lane_outlines AS l
    ON l.dataset = o.dataset AND l.version = o.version AND l.map_id = o.map_id AND l.lane_id = o.lane_id;
