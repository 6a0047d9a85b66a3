-- A vehicle comes into the ego's lane ahead of it: from when its near side is 0.3 m beyond the marking until its centre
-- is within 0.9 m of the ego's path. Parameters, when it is 0.3 m beyond the marking: `ego_speed`, `speed` [m/s], `gap`
-- [m] from bumper to bumper, and `lateral_speed` [m/s]. The gap is at most $max_gap, both are faster than $min_speed.
-- Source: UN Regulation 157, annex 4, appendix 3: cut-in with Ve0, Vo0, dx0 and Vy; 5.2.5.2 counts from 0.3 m beyond
-- the marking. ISO 34502: traffic disturbance, cut-in. The lane of 3.5 m around the driven path, means over half a
-- second and limits are our reading.
-- max_gap = 60.0
-- min_speed = 2.0
SELECT
    scenario_id, track_id, ego_id AS other_id, timestep AS first_timestep, middle AS last_timestep, gap AS value,
    ego_speed, speed, gap, lateral_speed
FROM corridor_crossings
WHERE direction < 0 AND gap BETWEEN 0 AND $max_gap AND least(speed, ego_speed) > $min_speed
