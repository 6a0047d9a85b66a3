-- needs: motions
-- One row per object and timestep at which it turns, `side` 1 to the left and -1 to the right: its heading changes
-- to one side without a break, by more than 45 degrees in all; or by more than 15, at 5 degrees/s on average, if its
-- track begins or ends in the turn. The first observation after the change belongs to it.
-- kept: relations and events read it again and again
CREATE VIEW turning_steps AS
WITH turning AS (
    SELECT scenario_id, track_id, unnest(timestep) AS timestep, unnest(turning) AS sides
    FROM motions
    WHERE list_max(turning) > 0
)
SELECT scenario_id, track_id, timestep, 1 AS side FROM turning WHERE sides & 1 <> 0
UNION ALL
SELECT scenario_id, track_id, timestep, -1 FROM turning WHERE sides & 2 <> 0;
