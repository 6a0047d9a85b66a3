-- needs: metadata_rows
-- Level of a row of metadata, 1 (easiest) to $count, with the lake's scenarios sorted by difficulty into levels of
-- equal size. Scenarios of equal difficulty have the same level. For example: WHERE difficulty_level(5) = 1.
CREATE MACRO difficulty_level("count") AS
1 + len(
    list_filter(
        (SELECT quantile_disc(rows.difficulty, list_transform(range(1, "count"), lambda k: k / "count")) FROM metadata_rows AS rows),
        lambda bound: difficulty > bound
    )
);
