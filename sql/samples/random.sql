-- Random order.
SELECT *, 0 AS turn
FROM ({lucky})
