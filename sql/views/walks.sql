-- needs: source_places, outline_gaps
-- One row per object: the timesteps at which it was observed and its `steps` there (see source_places), as lists, and
-- the box around all its places, smoothed and recorded, in the source's frame [m].
-- kept: relations read it again and again
CREATE VIEW walks AS
SELECT
    scenario_id, track_id, dataset, version, map_id, list(timestep) AS timesteps,
    list({
        'px': px, 'py': py, 'yaw_rate': yaw_rate, 'box_px': box_px, 'box_py': box_py,
        'heading': heading, 'length': length, 'width': width
    }) AS steps,
    min(least(px, box_px)) AS "left", max(greatest(px, box_px)) AS "right",
    min(least(py, box_py)) AS low, max(greatest(py, box_py)) AS high, max(length) AS length
FROM source_places
GROUP BY ALL;
