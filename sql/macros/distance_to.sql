-- needs: metadata
-- Distance of a scenario to another by an embedding, a user column of `metadata`: distance_to(v, 'pg/v2/7'). Null for
-- scenarios without a vector; an error if the other has none.
CREATE MACRO distance_to(embedding, id) AS list_distance(
    embedding,
    (
        SELECT coalesce(any_value(embedding), error('no vector of scenario ' || id || '; give a whole id'))
        FROM metadata WHERE scenario_id = id
    )
);
