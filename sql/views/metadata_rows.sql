-- Rows of the metadata files as stored.
CREATE VIEW metadata_rows AS
SELECT * FROM {files};
