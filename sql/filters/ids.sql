-- Scenarios whose id, or id in the source, is in the list $ids.
-- ids = []
scenario_id IN (SELECT unnest($ids::VARCHAR[])) OR source_scenario_id IN (SELECT unnest($ids::VARCHAR[]))
