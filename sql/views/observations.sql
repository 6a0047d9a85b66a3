-- One row per vehicle and recorded timestep: its observation.
CREATE VIEW observations AS
SELECT * {derived} FROM {files};
