-- needs: walked_lanes
-- One row per object and timestep at which it is on a lane (see walked_lanes), with `lane_offset` [m], how far the
-- smoothed centre of its box is to the left of the lane's middle.
-- kept: relations read it again and again
CREATE VIEW object_lanes AS
WITH steps AS (
    SELECT
        scenario_id, track_id, dataset, version, map_id, lanes,
        unnest(timesteps) AS timestep, unnest(found.lane) AS lane, unnest(found.aside) AS lane_offset
    FROM walked_lanes
)
SELECT
    scenario_id, track_id, timestep, dataset, version, map_id, lanes[lane].lane_id AS lane_id,
    lanes[lane].lane_type AS lane_type, lanes[lane].is_intersection AS is_intersection,
    lanes[lane].lane_heading AS lane_heading, lane_offset
FROM steps
WHERE lane IS NOT NULL;
