-- hard: No position, heading or velocity is NaN or infinite.
SELECT scenario_id, 'track ' || track_id AS detail
FROM tracks
WHERE NOT isfinite(
    coalesce(list_sum(x) + list_sum(y) + list_sum(heading) + list_sum(vx) + list_sum(vy), 0) + coalesce(list_sum(z), 0)
);
