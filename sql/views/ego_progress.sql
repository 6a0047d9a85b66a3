-- needs: ego_states
-- ego_states with `s` [m], the distance travelled along the ego's path.
-- kept: views of the ego read it again and again
CREATE VIEW ego_progress AS
SELECT * EXCLUDE (step), sum(step) OVER (PARTITION BY scenario_id ORDER BY timestep) AS s
FROM (
    SELECT
        *,
        coalesce(sqrt((x - lag(x) OVER earlier) ** 2 + (y - lag(y) OVER earlier) ** 2), 0) AS step
    FROM ego_states
    WINDOW earlier AS (PARTITION BY scenario_id ORDER BY timestep)
);
