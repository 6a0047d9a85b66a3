-- Scenarios on a list of whole ids, or of whole ids in the source.
-- ids = []
scenario_id IN (SELECT unnest($ids::VARCHAR[])) OR source_scenario_id IN (SELECT unnest($ids::VARCHAR[]))
