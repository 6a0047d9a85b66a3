-- One row per rejected scenario, with the reason.
CREATE VIEW quarantine AS
SELECT * {derived} FROM {files};
