-- The metadata files' rows as they are stored.
CREATE VIEW metadata_rows AS
SELECT * FROM {files};
