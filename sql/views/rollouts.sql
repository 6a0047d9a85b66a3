-- One row per object of every simulated scenario and rollout: its trajectory.
-- Files of version 1 have no column rollout: their runs have one.
CREATE VIEW rollouts AS
SELECT * REPLACE (coalesce(rollout, 0)::INTEGER AS rollout) {derived} FROM {files};
