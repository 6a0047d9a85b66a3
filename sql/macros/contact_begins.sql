-- Time [s] at which |d + v * t| first is at most `reach`: 0 if it already is, infinite if it never is.
CREATE MACRO contact_begins(d, v, reach) AS
CASE
    WHEN abs(d) <= reach THEN 0.0
    WHEN d * v >= 0 THEN 'infinity'::DOUBLE
    ELSE (abs(d) - reach) / abs(v)
END;
