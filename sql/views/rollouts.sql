-- One row per object of every simulated scenario: its trajectory.
CREATE VIEW rollouts AS
SELECT * {derived} FROM {files};
