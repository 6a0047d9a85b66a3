"""Private functions that are used once do not become more: a flow reads from top to bottom."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.single_use import count_single_use

ROOT = Path(__file__).parents[1]
MOST = {"scenarionet_data": 0.179, "scenarionet_sim": 0.141, "pipelines/scenarionet_pipelines": 0.145}
"""Share of all functions, by package: lower it when it has fallen."""


@pytest.mark.parametrize("package", MOST)
def test_share_of_private_functions_used_once_does_not_grow(package):
    count = count_single_use(ROOT / package)
    assert count.functions > 100
    assert count.share <= MOST[package], "inline those that name no idea: `python tests/single_use.py --list`"


def test_one_mention_counts_and_two_do_not(tmp_path):
    text = "def f():\n    return _once(_twice, key=_callback) + _twice()\n"
    text += "".join(f"def {name}():\n    pass\n" for name in ("_once", "_twice", "_callback", "_never", "__magic__"))
    (tmp_path / "a.py").write_text(text)
    assert count_single_use(tmp_path) == (6, ("a.py:3 _once", "a.py:7 _callback"))
