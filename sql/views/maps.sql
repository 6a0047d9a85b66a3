-- One row per map feature.
CREATE VIEW maps AS
SELECT * {derived} FROM {files};
