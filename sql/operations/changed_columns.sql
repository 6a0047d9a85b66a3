-- How many scenarios of two snapshots differ in each column, each with one example.
-- {rows_before} and {rows_after} are metadata files that only one of the snapshots has: the others cannot differ.
SELECT {columns}
FROM {rows_before} AS before JOIN {rows_after} AS after USING (scenario_id)
WHERE scenario_id IN (SELECT scenario_id FROM {before}) AND scenario_id IN (SELECT scenario_id FROM {after})
