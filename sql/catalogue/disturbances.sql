-- Disturbances of one definition, `found`, with where they happen, whether the ego changes lanes meanwhile (its timesteps
-- in `changing`), and the cell of the grid of parameters that they fall into: 5 m/s of the ego, 2.5 m/s of difference,
-- 5 m of gap, and 0.5 m/s to the side or 1 m/s^2. Rounded, so that they are the same to the last bit wherever they are
-- computed.
SELECT
    $definition AS definition,
    d.* EXCLUDE (value, {parameters}),
    {rounded},
    coalesce(road, 'none') AS road,
    c.scenario_id IS NOT NULL AS ego_changes_lane,
    concat_ws(
        '/', floor(ego_speed / 5)::INTEGER, floor((speed - ego_speed) / 2.5)::INTEGER, floor(gap / 5)::INTEGER,
        floor(coalesce(lateral_speed * 2, rate, 0))::INTEGER
    ) AS cell
FROM found AS d
LEFT JOIN (SELECT scenario_id, timestep AS first_timestep, road FROM ego_roads) USING (scenario_id, first_timestep)
LEFT JOIN (
    SELECT DISTINCT scenario_id, track_id, first_timestep
    FROM found JOIN changing USING (scenario_id)
    WHERE timestep BETWEEN first_timestep AND last_timestep
) AS c USING (scenario_id, track_id, first_timestep)
