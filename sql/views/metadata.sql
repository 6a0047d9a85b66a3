-- One row per scenario: the files' columns, timestamps filled in, and the contract's derived columns.
CREATE VIEW metadata AS
SELECT
    * REPLACE (coalesce(timestamps, list_transform(range(num_timesteps), lambda k: k * dt)) AS timestamps)
    {derived}
FROM {files};
