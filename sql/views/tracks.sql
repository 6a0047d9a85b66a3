-- One row per object of a scenario, lists over its span; dataset, version and split are read from the folder names.
CREATE VIEW tracks AS
SELECT * {derived} FROM {files};
