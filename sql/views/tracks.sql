-- One row per object of a scenario, lists over its span; dataset, version and split come from the folders.
CREATE VIEW tracks AS
SELECT * {derived} FROM {files};
