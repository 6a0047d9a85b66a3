-- Scenarios on one level: road lines and edges differ by less than $max metres in height. Maps without heights are kept.
-- max = 5.0
map_height_diff IS NULL OR map_height_diff < $max
