-- Scenarios with at least $min and at most $max objects, the ego included.
-- min = 0
-- max = 1000000000
num_objects BETWEEN $min AND $max
