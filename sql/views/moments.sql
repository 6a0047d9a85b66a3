-- needs: moments_rows, metadata_rows
-- One row per kept moment of a scenario of this snapshot; `ego_id` is the scenario's ego.
CREATE VIEW moments AS
SELECT moments_rows.*, ego_id
FROM moments_rows JOIN (SELECT scenario_id, content_hash, ego_id FROM metadata_rows) USING (scenario_id, content_hash)
WHERE first_timestep IS NOT NULL;
