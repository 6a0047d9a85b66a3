-- One row per vehicle and recorded timestep: what it observes there.
CREATE VIEW observations AS
SELECT * {derived} FROM {files};
