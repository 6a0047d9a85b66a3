-- The first of two times if it is before the second, otherwise null.
CREATE MACRO if_before(first, second) AS CASE WHEN first < second THEN first END;
