-- The nearest vehicle ahead on the ego's path is stationary (slower than 0.5 m/s), at most $max_gap metres from bumper
-- to bumper, for at least $min_duration seconds. Value is the smallest gap, in m.
-- Source: the stationary vehicle target of Euro NCAP's car-to-car rear stationary test (CCRs), seen from the ego.
-- max_gap = 30.0
-- min_duration = 1.0
WITH standing AS (
    SELECT *, timestep - row_number() OVER (PARTITION BY scenario_id, track_id ORDER BY timestep) AS run
    FROM ego_leads
    WHERE speed < 0.5 AND gap <= $max_gap
)
SELECT
    scenario_id,
    ego_id AS track_id,
    track_id AS other_id,
    min(timestep) AS first_timestep,
    max(timestep) AS last_timestep,
    min(gap) AS value
FROM standing
GROUP BY scenario_id, ego_id, standing.track_id, run
HAVING max(seconds) - min(seconds) >= $min_duration
