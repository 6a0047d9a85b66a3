"""Parameters of a logical scenario have the joint distribution of what was measured."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.logical import fit_logical, read_logical
from scenarionet_data.logical.description import parse_logical

stats = pytest.importorskip("scipy.stats", reason="the extra `vary` is not installed")


def measured(count: int = 2000, correlation: float = -0.6) -> pl.DataFrame:
    """Gaps of a lognormal and speeds of a normal distribution, of which the normal scores are correlated."""
    scores = np.random.default_rng(1).multivariate_normal([0, 0], [[1, correlation], [correlation, 1]], count)
    return pl.DataFrame(
        {"gap": np.exp(2 + 0.5 * scores[:, 0]), "ego_speed": 20 + 3 * scores[:, 1], "place": ["here"] * count}
    )


def test_drawn_scenarios_have_the_quantiles_and_ranks_of_what_was_measured():
    rows = measured()
    fitted = parse_logical(fit_logical("cut_in", rows), "cut_in")
    names = [each.name for each in fitted.parameters]
    assert fitted.actors == read_logical("cut_in").actors
    drawn = pl.DataFrame(fitted.draw(4000, seed=0), schema=names)
    for name in ("gap", "ego_speed"):
        for share in (0.1, 0.5, 0.9):
            assert drawn[name].quantile(share) == pytest.approx(rows[name].quantile(share), rel=0.04)
        assert rows[name].min() - 1e-3 <= drawn[name].min() and drawn[name].max() <= rows[name].max() + 1e-3
    ranks = stats.spearmanr(drawn["gap"], drawn["ego_speed"]).statistic
    assert ranks == pytest.approx(stats.spearmanr(rows["gap"], rows["ego_speed"]).statistic, abs=0.05)
    assert abs(stats.spearmanr(drawn["gap"], drawn["slower"]).statistic) < 0.05, "it was not measured"
    assert drawn["slower"].min() >= 0 and drawn["slower"].max() <= 10


def test_a_fitted_file_is_read_again(tmp_path):
    path = tmp_path / "fitted.toml"
    path.write_text(fit_logical("cut_in", measured()))
    again = fit_logical(path, measured(correlation=0.5))
    assert again.count("[parameters]") == again.count("[correlation]") == 1
    assert parse_logical(again, "cut_in").correlations(["gap", "ego_speed"])[0, 1] == pytest.approx(0.5, abs=0.05)


def test_a_constant_column_and_missing_values():
    rows = measured(40).with_columns(
        ego_speed=pl.lit(20.0), gap=pl.when(pl.int_range(40) < 5).then(float("nan")).otherwise(pl.col("gap"))
    )
    fitted = parse_logical(fit_logical("cut_in", rows), "cut_in")
    assert not fitted.correlation
    assert (fitted.draw(10)[:, 0] == 20.0).all()


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (measured(5), "5 occurrences have numbers of ego_speed, gap; wanted 10"),
        (pl.DataFrame({"distance": [1.0] * 20}), "is one of its parameters ego_speed, slower, gap, lateral_time"),
    ],
)
def test_what_cannot_be_fitted(rows, told):
    with pytest.raises(BadParameter, match=told):
        fit_logical("cut_in", rows)


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ('"gap, ego_speed" = 1.5', "wanted two of .* and -1 to 1"),
        ('"gap, ego_speed" = "much"', "wanted two of"),
        ('"gap, weight" = 0.5', "wanted two of"),
        ('"gap" = 0.5', "wanted two of"),
        ('"gap, gap" = 1', "wanted two of"),
        ('"gap, slower" = 0.9\n"gap, ego_speed" = 0.9\n"slower, ego_speed" = -0.9', "contradict each other"),
    ],
)
def test_correlations_that_cannot_be(table, told):
    text = read_logical("cut_in").text
    with pytest.raises(BadParameter, match=told):
        parse_logical(f"{text}\n[correlation]\n{table}\n", "mine")


@pytest.mark.parametrize("text", ["quantiles(3, 1)", "quantiles(3)", "quantiles(1, nan)", "quantiles()"])
def test_quantiles_that_cannot_be(text):
    logical = read_logical("cut_in").text.replace("[2, 28] ", f'"{text}"')
    with pytest.raises(BadParameter, match="gap=quantiles"):
        parse_logical(logical, "mine")
