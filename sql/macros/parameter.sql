-- A parameter of a variation or of a concrete scenario, by its name, from the column `extras` of `metadata`.
CREATE MACRO parameter(extras, name) AS CAST(extras -> '$.parameters' ->> name AS DOUBLE);
