-- The very scenario, by its id.
SELECT parent, scenario_id, scenario_id AS key
FROM members
