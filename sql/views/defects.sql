-- One row per kind of defect of a scenario or shared map: rows that were dropped or completed, with the reason.
CREATE VIEW defects AS
SELECT * {derived} FROM {files};
