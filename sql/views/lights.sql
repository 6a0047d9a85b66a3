-- One row per lane whose traffic light is recorded.
CREATE VIEW lights AS
SELECT * {derived} FROM {files};
