-- needs: object_states
-- object_states; for queries that name one of them, with the columns of state_lanes: the lane that the object is on.
CREATE VIEW states AS SELECT * FROM object_states {lanes};
