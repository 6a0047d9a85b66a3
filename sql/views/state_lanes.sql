-- needs: object_lanes
-- One row per object and timestep at which it is on a lane (see object_lanes): `lane_id`, `lane_type`, and `lane_offset`
-- [m], how far the middle of its box, smoothed, is to the left of the lane's. Queries of `states` that name one of the
-- three get them there, null off the lanes.
CREATE VIEW state_lanes AS
SELECT scenario_id, track_id, timestep, lane_id, lane_type, lane_offset FROM object_lanes;
