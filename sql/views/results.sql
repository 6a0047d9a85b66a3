-- One row per scenario and evaluated vehicle of every simulation run: outcome and metrics.
CREATE VIEW results AS
SELECT * {derived} FROM {files};
