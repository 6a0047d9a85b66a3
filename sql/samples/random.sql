-- One round: scenarios are drawn by priority alone.
SELECT *, 0 AS round
FROM ({priorities})
