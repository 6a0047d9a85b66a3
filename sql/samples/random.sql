-- Turns by luck alone.
SELECT *, 0 AS turn
FROM ({lucky})
