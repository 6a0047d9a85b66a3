-- One row per object of every simulated scenario: what it did.
CREATE VIEW rollouts AS
SELECT * {derived} FROM {files};
