from __future__ import annotations

from scenarionet_data.ingest.defects import Defect, Defects, merge_defects


def test_defects_of_one_kind_are_counted_together_and_the_first_are_named():
    defects = Defects()
    for row in range(0, 9000, 1000):
        defects.drop("tracks", "a.csv", [row], "size", f"expected a size above 0 m, found {-row}")
    defects.drop("tracks", "a.csv", [], "size", "expected nothing")
    defects.drop("tracks", "b.csv", [7], "size", "expected a size above 0 m, found 0")
    defects.assume("maps", "m.json", ["lane 3", "lane 4"], "type", "expected a known type, found 'TRAM'")
    assert defects.found() == (
        Defect("tracks", "a.csv", "rows 0, 1,000, 2,000, ...", "size", "dropped",
               "expected a size above 0 m, found 0", 9),
        Defect("tracks", "b.csv", "row 7", "size", "dropped", "expected a size above 0 m, found 0", 1),
        Defect("maps", "m.json", "lane 3, lane 4", "type", "assumed", "expected a known type, found 'TRAM'", 2),
    )  # fmt: skip


def test_merged_defects_keep_the_first_locations_and_the_sum():
    first, other = Defects(), Defects()
    first.drop("tracks", "a.csv", [1], "size", "expected more, found 0")
    other.drop("tracks", "a.csv", [2, 3], "size", "expected more, found -1")
    other.assume("tracks", "a.csv", [2], "size", "expected more, found -1")
    (dropped, assumed) = merge_defects((*first.found(), *other.found()))
    assert (dropped.count, dropped.location, dropped.reason) == (3, "row 1", "expected more, found 0")
    assert (assumed.count, assumed.action) == (1, "assumed")
