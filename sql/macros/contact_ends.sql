-- When [s] |d + v * t| is last at most `reach`: infinite where it stays, below 0 where it never is again.
CREATE MACRO contact_ends(d, v, reach) AS
CASE
    WHEN v <> 0 THEN reach / abs(v) - d / v
    WHEN abs(d) <= reach THEN 'infinity'::DOUBLE
    ELSE -1.0
END;
