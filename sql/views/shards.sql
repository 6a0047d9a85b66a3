-- One row per converted shard: what went in, which files came out.
CREATE VIEW shards AS
SELECT * {derived} FROM {files};
