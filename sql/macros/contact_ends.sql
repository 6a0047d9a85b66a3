-- Time [s] at which |d + v * t| last is at most `reach`: infinite if it remains so, negative if that time has passed.
CREATE MACRO contact_ends(d, v, reach) AS
CASE
    WHEN v <> 0 THEN reach / abs(v) - d / v
    WHEN abs(d) <= reach THEN 'infinity'::DOUBLE
    ELSE -1.0
END;
