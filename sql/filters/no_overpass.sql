-- Scenarios on one level: the heights of road lines and edges differ by less than $max metres. Maps without heights
-- pass.
-- max = 5.0
map_height_diff IS NULL OR map_height_diff < $max
