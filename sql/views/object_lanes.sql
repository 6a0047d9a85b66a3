-- needs: source_places, lane_outlines, in_outline
-- One row per object and timestep at which it is on a lane, by the smoothed centre of its box. Where lanes overlap,
-- as on intersections, it is on the lane that holds most of its timesteps, then on the one that holds most of the
-- rest, and so on; of equal ones on that which turns as it does (up to 0.15 rad/s is straight on).
-- kept: relations read it again and again
CREATE VIEW object_lanes AS
WITH RECURSIVE held AS MATERIALIZED (
    SELECT
        scenario_id, track_id, timestep, dataset, version, map_id, lane_id, lane_type, is_intersection, lane_heading,
        is_intersection
            AND turns = CASE WHEN abs(avg(yaw_rate) OVER lane) > 0.15 THEN sign(avg(yaw_rate) OVER lane) ELSE 0 END AS fits
    FROM source_places JOIN lane_outlines USING (dataset, version, map_id)
    WHERE px BETWEEN min_x AND max_x AND py BETWEEN min_y AND max_y AND in_outline(px, py, xs, ys)
    WINDOW lane AS (PARTITION BY scenario_id, track_id, lane_id)
),
choices AS (
    SELECT *, NULL::VARCHAR AS best, false AS is_taken FROM held
    UNION ALL
    SELECT
        * EXCLUDE (best, num_held, is_taken), best,
        bool_or(lane_id = best) OVER (PARTITION BY scenario_id, track_id, timestep)
    FROM (
        SELECT
            *,
            first_value(lane_id) OVER (
                PARTITION BY scenario_id, track_id ORDER BY num_held DESC, fits DESC, lane_id
            ) AS best
        FROM (
            SELECT * EXCLUDE (best), count(*) OVER (PARTITION BY scenario_id, track_id, lane_id) AS num_held
            FROM choices
            WHERE NOT is_taken
        )
    )
)
SELECT scenario_id, track_id, timestep, dataset, version, map_id, lane_id, lane_type, is_intersection, lane_heading
FROM choices
WHERE lane_id = best;
