-- needs: corridor_steps
-- corridor_steps with `acceleration` [m/s^2], the slope of the recorded speeds over one second, and `speed_before`,
-- `ego_speed_before` [m/s] and `gap_before` [m]: means over the second that ended half a second ago.
CREATE VIEW corridor_rates AS
SELECT
    s.*,
    regr_slope(recorded_speed, seconds) OVER second AS acceleration,
    avg(s.speed) OVER earlier AS speed_before,
    avg(s.ego_speed) OVER earlier AS ego_speed_before,
    avg(s.gap) OVER earlier AS gap_before
FROM corridor_steps AS s
JOIN (SELECT scenario_id, track_id, timestep, speed AS recorded_speed FROM ego_corridor)
    USING (scenario_id, track_id, timestep)
WINDOW
    second AS (PARTITION BY scenario_id, track_id ORDER BY seconds RANGE BETWEEN 0.51 PRECEDING AND 0.51 FOLLOWING),
    earlier AS (PARTITION BY scenario_id, track_id ORDER BY seconds RANGE BETWEEN 1.51 PRECEDING AND 0.51 PRECEDING);
