-- One row per scenario: the stored columns with timestamps filled in, the derived columns of the schema,
-- and user columns.
CREATE VIEW metadata AS
SELECT
    * REPLACE (coalesce(timestamps, list_transform(range(num_timesteps), lambda k: k * dt)) AS timestamps)
    {derived}
FROM {files} AS files {layers};
