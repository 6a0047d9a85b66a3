-- One row per scenario, rollout and evaluated vehicle of every simulation run: outcome and metrics.
-- Files of version 1 have no column rollout: their runs have one; and no is_time_to_collision_in_bound.
CREATE VIEW results AS
SELECT * REPLACE (
    coalesce(rollout, 0)::INTEGER AS rollout,
    CASE
        WHEN error IS NULL THEN coalesce(is_time_to_collision_in_bound, coalesce(min_time_to_collision, 3.0) >= 0.95)
    END AS is_time_to_collision_in_bound
) {derived} FROM {files};
