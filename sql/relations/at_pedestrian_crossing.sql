-- An object's box is within $within_distance metres of a pedestrian crossing, or on it.
-- within_distance = 1.0
WITH near AS (
    SELECT
        scenario_id, track_id, timestep, length, width,
        -- the crossing in the frame of the box
        list_transform(
            range(1, len(xs) + 1), lambda i: (xs[i] - box_px) * cos(heading) + (ys[i] - box_py) * sin(heading)
        ) AS aheads,
        list_transform(
            range(1, len(xs) + 1), lambda i: (ys[i] - box_py) * cos(heading) - (xs[i] - box_px) * sin(heading)
        ) AS lefts
    FROM source_places JOIN map_areas USING (dataset, version, map_id)
    WHERE
        feature_type = 'CROSSWALK'
        AND box_px BETWEEN min_x - length - $within_distance AND max_x + length + $within_distance
        AND box_py BETWEEN min_y - length - $within_distance AND max_y + length + $within_distance
)
SELECT DISTINCT scenario_id, track_id, timestep
FROM near
WHERE
    in_outline(0.0, 0.0, aheads, lefts)
    OR list_min(list_transform(
        [[1, 1], [1, -1], [-1, 1], [-1, -1]],
        lambda side: outline_gap(side[1] * length / 2, side[2] * width / 2, aheads, lefts)
    )) <= $within_distance
    OR list_min(list_transform(
        range(1, len(aheads) + 1),
        lambda i: sqrt(
            greatest(abs(aheads[i]) - length / 2, 0) ** 2 + greatest(abs(lefts[i]) - width / 2, 0) ** 2
        )
    )) <= $within_distance
