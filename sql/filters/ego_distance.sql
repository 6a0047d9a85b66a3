-- Scenarios whose ego travels at least $min and at most $max metres.
-- min = 10.0
-- max = 1e9
ego_distance BETWEEN $min AND $max
