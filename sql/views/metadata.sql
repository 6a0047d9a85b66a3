-- One row per scenario: the files' columns, timestamps filled in, the contract's derived columns, and the
-- user columns and the row that the query names.
CREATE VIEW metadata AS
SELECT
    * REPLACE (coalesce(timestamps, list_transform(range(num_timesteps), lambda k: k * dt)) AS timestamps)
    {derived} {row}
FROM {files} AS files {user_columns};
