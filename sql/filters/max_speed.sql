-- Scenarios whose ego reaches at least $min and at most $max metres per second.
-- min = 0.0
-- max = 1e9
ego_max_speed BETWEEN $min AND $max
