-- needs: smoothed
-- One row per object and timestep at which it turns, `side` 1 to the left and -1 to the right: its heading changes
-- to one side without a break, by more than 45 degrees in all; or by more than 15, at 5 degrees/s on average, if its
-- track begins or ends in the turn.
-- kept: relations and events read it again and again
CREATE VIEW turning_steps AS
WITH signs AS (
    SELECT
        scenario_id, track_id, timestep, degrees(yaw_rate) AS rate, sign(yaw_rate) AS side,
        row_number() OVER track AS i,
        count(*) OVER (PARTITION BY scenario_id, track_id) AS n,
        lead(seconds) OVER track - seconds AS gap,
        coalesce(side = 0 OR side <> lag(side) OVER track, true) AS begins
    FROM smoothed
    WINDOW track AS (PARTITION BY scenario_id, track_id ORDER BY timestep)
),
runs AS (
    SELECT
        * EXCLUDE (gap),
        sum(begins::INTEGER) OVER track AS run,
        first_value(gap) OVER track AS step
    FROM signs
    WINDOW track AS (PARTITION BY scenario_id, track_id ORDER BY i)
),
extended AS (  -- a run includes the first observation of the next one, at which the turn ends
    SELECT * FROM runs
    UNION ALL
    SELECT * REPLACE (run - 1 AS run) FROM runs WHERE begins AND run > 1
),
turns AS (
    SELECT
        *,
        sum(rate * step) OVER whole AS turned,
        avg(rate) OVER whole AS mean_rate,
        max(rate) FILTER (i IN (1, n)) OVER whole AS leftmost,
        min(rate) FILTER (i IN (1, n)) OVER whole AS rightmost
    FROM extended
    WINDOW whole AS (PARTITION BY scenario_id, track_id, run)
)
SELECT DISTINCT scenario_id, track_id, timestep, sign(turned)::INTEGER AS side
FROM turns
WHERE
    abs(turned) > 45
    OR turned > 15 AND mean_rate > 5 AND leftmost > 5
    OR turned < -15 AND mean_rate < -5 AND rightmost < -5;
