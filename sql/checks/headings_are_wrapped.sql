-- hard: Headings are in [-pi, pi), in stored precision.
SELECT scenario_id, 'track ' || track_id || ' has a heading of ' || list_min(heading) || ' ... ' || list_max(heading) AS detail
FROM tracks
WHERE list_min(heading) < (-pi())::FLOAT OR list_max(heading) >= pi()::FLOAT;
