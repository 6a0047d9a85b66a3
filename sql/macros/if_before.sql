-- The first of two times when it is before the second, else null.
CREATE MACRO if_before(first, second) AS CASE WHEN first < second THEN first END;
