-- One row per vehicle, recorded timestep, camera and channel: a picture.
CREATE VIEW frames AS
SELECT * {derived} FROM {files};
