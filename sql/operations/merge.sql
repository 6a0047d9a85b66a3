-- Members of all parents, one parent after the other; a scenario of several parents comes with the first.
SELECT members.scenario_id, members.weight, members.content_hash
FROM members
ANTI JOIN (FROM members WHERE parent < {last}) AS earlier
    ON earlier.scenario_id = members.scenario_id AND earlier.parent < members.parent
ORDER BY members.parent, members.position
