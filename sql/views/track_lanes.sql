-- needs: state_lanes
-- One row per object that is ever on a lane: the lane on which it is longest, with its `lane_type`, and its mean
-- `lane_offset` [m] there. Queries of `objects` that name one of the three get them there, null off the lanes.
CREATE VIEW track_lanes AS
SELECT scenario_id, track_id, lane_id, any_value(lane_type) AS lane_type, avg(lane_offset) AS lane_offset
FROM state_lanes
GROUP BY scenario_id, track_id, lane_id
QUALIFY row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY count(*) DESC, lane_id) = 1;
