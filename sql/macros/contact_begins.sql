-- When [s] |d + v * t| first comes to at most `reach`: 0 where it is already, infinite where it never does.
CREATE MACRO contact_begins(d, v, reach) AS
CASE
    WHEN abs(d) <= reach THEN 0.0
    WHEN d * v >= 0 THEN 'infinity'::DOUBLE
    ELSE (abs(d) - reach) / abs(v)
END;
