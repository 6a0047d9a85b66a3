-- Rows of kept moments as stored, with a row without timesteps for each scenario that has none; of each definition, those
-- of its newest version.
CREATE VIEW moments_rows AS
SELECT * FROM {files};
