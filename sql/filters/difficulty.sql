-- Scenarios whose difficulty (ego distance times cumulative curvature) lies in a band.
-- min = 0.0
-- max = 1e9
difficulty BETWEEN $min AND $max
