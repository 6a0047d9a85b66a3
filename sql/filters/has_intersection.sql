-- Scenarios with an intersection.
has_intersection
