-- One row per scenario and judged vehicle of every run of the simulator: how it ended, and every metric.
CREATE VIEW results AS
SELECT * {derived} FROM {files};
