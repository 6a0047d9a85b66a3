-- needs: ego_corridor
-- One row per timestep at which a vehicle is ahead of the ego on its path: the nearest one whose centre is within 1.5 m
-- of the path. `gap` [m] is from bumper to bumper along the path, `headway` [s] from front to front at the ego's speed.
CREATE VIEW ego_leads AS
SELECT
    scenario_id,
    ego_id,
    track_id,
    timestep,
    seconds,
    ahead - (length + ego_length) / 2 AS gap,
    (ahead + (length - ego_length) / 2) / nullif(ego_speed, 0) AS headway,
    speed,
    ego_speed
FROM ego_corridor
WHERE object_type = 'VEHICLE' AND abs("left") <= 1.5 AND ahead > 0
QUALIFY row_number() OVER (PARTITION BY scenario_id, timestep ORDER BY ahead, track_id) = 1;
