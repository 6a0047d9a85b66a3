-- Whether the rows of `again` equal the members of a database, order included.
SELECT count(*) = (SELECT count(*) FROM {members}) AND count(*) = (SELECT count(*) FROM again) AS is_same
FROM {members} AS members JOIN (SELECT *, row_number() OVER () - 1 AS position FROM again) AS made USING (position)
WHERE members.scenario_id = made.scenario_id AND members.weight = made.weight
    AND members.content_hash = made.content_hash
