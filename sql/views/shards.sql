-- One row per converted shard: raw inputs and files written.
CREATE VIEW shards AS
SELECT * {derived} FROM {files};
