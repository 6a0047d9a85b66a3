-- The middle one of three numbers.
CREATE MACRO middle_of_three(a, b, c) AS greatest(least(a, b), least(greatest(a, b), c));
