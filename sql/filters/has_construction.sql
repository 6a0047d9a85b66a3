-- Scenarios with traffic cones or barriers.
has_construction
