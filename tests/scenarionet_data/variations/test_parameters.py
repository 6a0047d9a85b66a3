"""Distributions of parameters, and values drawn from them."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.variations.parameters import VariedParameter, draw, parse_parameters


def test_values_at_quantiles():
    at = np.array([0.0, 0.25, 0.999])
    assert VariedParameter("ego.start", "-1:3").at(at).tolist() == pytest.approx([-1, 0, 2.996])
    assert VariedParameter("t1.remove", "0,1").at(at).tolist() == [0, 0, 1]
    assert VariedParameter("a.b.gap", "2.5").at(at).tolist() == [2.5] * 3
    assert VariedParameter("nearest.gap", "norm(1, 2)").at(np.array([0.5, 0.975])) == pytest.approx(
        [1, 1 + 2 * 1.959964]
    )
    assert VariedParameter("a.b.gap", "1").target == "a.b", "ids of tracks may have dots"


def test_texts_numbers_and_pairs():
    found = parse_parameters({"ego.speed": (0.5, 1.5), "ego.gap": 2, "lights.start": "-1:1"})
    assert [each.distribution for each in found] == ["0.5:1.5", "2", "-1:1"]


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("ego.speed", "1.2:0.8", "LOW at most HIGH"),
        ("ego.speed", "nan:1", "wanted LOW:HIGH"),
        ("ego.speed", "fast", "wanted LOW:HIGH"),
        ("ego.speed", "-1:1", "gives -1; speed is a factor above 0"),
        ("ego.gap", "norm(0, -1)", "gives nan"),
        ("ego.gap", "normal(0, 1)", "no continuous distribution 'normal'"),
        ("ego.colour", "1", "one of the changes pace, start"),
        ("lights.gap", "1", "or lights.start, road.friction"),
        ("t1.replace", "0:2", r"wanted 0 \(as it is\), 1 \(car\)"),
        ("ego.remove", "1", "a scenario needs its ego"),
    ],
)
def test_bad_input_is_a_sentence(name, values, message):
    with pytest.raises(BadParameter, match=message):
        VariedParameter(name, values)


def test_draws_are_repeated_extended_and_different_for_each_parent():
    parameters = parse_parameters({"ego.start": "0:1", "ego.gap": "0:1"})
    for method in ("random", "sobol"):
        few, many = draw(parameters, 5, 3, method, "a"), draw(parameters, 50, 3, method, "a")
        assert np.array_equal(few, many[:5]) and not np.array_equal(few, draw(parameters, 5, 3, method, "b"))
        assert not np.array_equal(few, draw(parameters, 5, 4, method, "a"))
    latin = draw(parameters, 10, method="latin")
    assert (np.arange(10) == np.sort((latin * 10).astype(int), axis=0).T).all(), "one in each tenth of every axis"
    with pytest.raises(BadParameter, match="from 1 and from 0 on"):
        draw(parameters, 0)
