-- needs: ego_progress, object_lanes, lane_outlines
-- One row per timestep of the ego: `meters` and `duration` [s] since the step before, and the `road` it is on:
-- intersection, where the map says so; merge, a lane whose next one has another before it; branch, a lane with several
-- next ones; road, any other lane; or none, off the lanes or without a map.
-- kept: disturbances read it again and again
CREATE VIEW ego_roads AS
WITH sections AS (
    SELECT
        dataset, version, map_id, lane_id,
        CASE
            WHEN l.is_intersection THEN 'intersection'
            WHEN merges THEN 'merge'
            WHEN len(exit_lanes) > 1 THEN 'branch'
            ELSE 'road'
        END AS road
    FROM lane_outlines AS l LEFT JOIN (
        SELECT n.dataset, n.version, n.map_id, b.lane_id, true AS merges
        FROM (SELECT dataset, version, map_id, lane_id, unnest(exit_lanes) AS exit_lane FROM lane_outlines) AS b
        JOIN lane_outlines AS n ON
            n.dataset = b.dataset AND n.version = b.version AND n.map_id = b.map_id AND n.lane_id = exit_lane
        WHERE len(n.entry_lanes) > 1
        GROUP BY ALL
    ) USING (dataset, version, map_id, lane_id)
)
SELECT
    scenario_id, timestep, seconds, step AS meters,
    coalesce(seconds - lag(seconds) OVER (PARTITION BY scenario_id ORDER BY timestep), 0) AS duration,
    coalesce(road, 'none') AS road
FROM (
    SELECT scenario_id, track_id, timestep, seconds,
        coalesce(s - lag(s) OVER (PARTITION BY scenario_id ORDER BY timestep), 0) AS step
    FROM ego_progress
)
LEFT JOIN (
    SELECT scenario_id, track_id, timestep, road
    FROM object_lanes JOIN sections USING (dataset, version, map_id, lane_id)
) USING (scenario_id, track_id, timestep);
