-- Number of scenarios of two snapshots that differ in each column, with one example each.
-- {rows_before} and {rows_after} are the metadata files that only one of the snapshots has; shared files cannot differ.
SELECT {columns}
FROM {rows_before} AS before JOIN {rows_after} AS after USING (scenario_id)
WHERE scenario_id IN (SELECT scenario_id FROM {before}) AND scenario_id IN (SELECT scenario_id FROM {after})
