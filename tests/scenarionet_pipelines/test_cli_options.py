"""Parsing of converter options."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Options
from scenarionet_pipelines.cli.converter import find, options, parse_options
from tests.fixtures.made import Made

pytestmark = pytest.mark.integration


@dataclass(frozen=True)
class AllKinds(Options):
    number: int = 1
    share: float = 0.5
    is_fast: bool = True
    name: str = "a"
    mode: Literal["whole", "windows"] = "whole"
    limit: int | None = None
    cities: tuple[str, ...] = ("boston",)
    box: tuple[float, float] = field(default=(0.0, 1.0), metadata={"doc": "From and to."})


class Every(Made):
    Options = AllKinds


def parse(*words: str) -> AllKinds:
    return parse_options(Every(), words)


def test_every_type():
    words = (
        "number=3",
        "share=1e-1",
        "is_fast=no",
        "name=b=c",
        "mode=windows",
        "limit=7",
        "cities=a,b",
        "box=1,2.5",
    )
    assert parse(*words) == AllKinds(3, 0.1, False, "b=c", "windows", 7, ("a", "b"), (1.0, 2.5))
    assert parse("limit=none", "cities=") == AllKinds(limit=None, cities=())
    assert parse() == AllKinds()


@pytest.mark.parametrize(
    "word",
    [
        "number=x",
        "number=1.5",
        "share=much",
        "is_fast=maybe",
        "mode=half",
        "limit=x",
        "box=1",
        "box=1,2,3",
        "nothing=1",
    ],
)
def test_invalid_values_are_rejected(word):
    with pytest.raises(BadParameter, match=word.split("=")[0]):
        parse(word)


def test_options_are_described():
    found = {option.name: option for option in options(Every.Options)}
    assert found["box"].doc == "From and to."
    assert found["limit"].type_text == "int | None"
    assert found["mode"].type_text == "Literal['whole', 'windows']"


def test_class_in_the_current_folder_is_found(tmp_path: Path, monkeypatch):
    (tmp_path / "my_own_dataset.py").write_text("from tests.fixtures.made import Made\nclass Mine(Made):\n    pass\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", __import__("sys").path.copy())
    assert find("my_own_dataset:Mine").name == "made"
