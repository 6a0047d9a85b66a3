"""Input properties that are read from a file require the file to be local."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from scenarionet_data.conversion import InputSelection
from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.input_properties import PLACEHOLDER, LazyProperties, is_local
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard


def first_word(path: Path, key: str) -> str:
    return f"{key} {path.read_text().split()[0]}"


@pytest.fixture
def properties(tmp_path):
    return LazyProperties({"log": "a"}, ("tag",), first_word, tmp_path / "file")


def test_properties_of_a_local_file(properties):
    properties.path.write_text("left turn")
    assert is_local(properties.path)
    assert dict(pickle.loads(pickle.dumps(properties))) == {"log": "a", "tag": "tag left"}
    assert len(properties) == 2
    with pytest.raises(KeyError):
        properties["speed"]


def test_properties_of_a_remote_file(properties):
    properties.path.write_bytes(PLACEHOLDER + b"mark")
    assert not is_local(properties.path)
    assert dict(properties) == {"log": "a"}
    assert properties.get("tag") is None
    root = str(properties.path.parent)
    shard = Shard("made", "v1", "train", "one", root, (RawItem("file", "", properties),), Options())
    assert InputSelection({"log": "a"}).select([shard]) == [shard]
    with pytest.raises(BadParameter, match=r"inputs can be selected by file, log, name; .* copy them first"):
        InputSelection({"tag": "*"}).select([shard])


def test_unreadable_file_is_not_treated_as_placeholder(properties):
    assert is_local(properties.path)
