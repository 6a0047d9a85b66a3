-- Scenarios whose difficulty (ego distance times cumulative curvature) is at least $min and at most $max.
-- min = 0.0
-- max = 1e9
difficulty BETWEEN $min AND $max
