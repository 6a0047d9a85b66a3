-- Members of all databases, one database after the other; duplicates are kept where they occur first.
SELECT members.scenario_id, members.weight, members.content_hash
FROM members
ANTI JOIN (FROM members WHERE parent < {last}) AS earlier
    ON earlier.scenario_id = members.scenario_id AND earlier.parent < members.parent
ORDER BY members.parent, members.position
