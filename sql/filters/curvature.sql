-- Scenarios whose ego turns by at least $min and at most $max radians in total, left and right turns added up.
-- min = 0.0
-- max = 1e9
ego_cumulative_curvature BETWEEN $min AND $max
