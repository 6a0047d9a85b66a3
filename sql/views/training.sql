-- One row per round of every training run, and per test and checkpoint: the learning curve.
CREATE VIEW training AS
SELECT * {derived} FROM {files};
