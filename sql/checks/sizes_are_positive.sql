-- hard: Length, width and height of every observed object are positive.
SELECT
    scenario_id,
    'track ' || track_id || ' has a size of '
    || concat_ws(' x ', list_min(length), list_min(width), list_min(height)) || ' m at some timestep' AS detail
FROM tracks
WHERE
    least(list_min(length), list_min(width), list_min(height)) <= 0  -- cheap test first: most sizes are positive at unobserved steps, too
    AND (
        list_min(CASE WHEN len(valid) = len(length) THEN list_where(length, valid) ELSE length END) <= 0
        OR list_min(CASE WHEN len(valid) = len(width) THEN list_where(width, valid) ELSE width END) <= 0
        OR list_min(CASE WHEN len(valid) = len(height) THEN list_where(height, valid) ELSE height END) <= 0
    );
