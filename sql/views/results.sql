-- One row per scenario, rollout and evaluated vehicle of every simulation run: outcome and metrics.
-- Files of version 1 have no column rollout: their runs have one.
CREATE VIEW results AS
SELECT * REPLACE (coalesce(rollout, 0)::INTEGER AS rollout) {derived} FROM {files};
