-- The same scenario, by id.
SELECT parent, scenario_id, scenario_id AS key
FROM members
