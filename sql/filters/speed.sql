-- Scenarios whose ego drives at least $min and at most $max metres per second on average.
-- min = 0.0
-- max = 1e9
ego_mean_speed BETWEEN $min AND $max
