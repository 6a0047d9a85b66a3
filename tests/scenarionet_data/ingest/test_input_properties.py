"""Facts that a file tells are known where the file is."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from scenarionet_data.conversion import Selection
from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.input_properties import PLACEHOLDER, FactsOnDemand, is_at_hand
from scenarionet_data.ingest.shard import Options, RawItem, Shard


def first_word(path: Path, key: str) -> str:
    return f"{key} {path.read_text().split()[0]}"


@pytest.fixture
def facts(tmp_path):
    return FactsOnDemand({"log": "a"}, ("tag",), first_word, tmp_path / "file")


def test_facts_of_a_file_that_is_here(facts):
    facts.path.write_text("left turn")
    assert is_at_hand(facts.path)
    assert dict(pickle.loads(pickle.dumps(facts))) == {"log": "a", "tag": "tag left"}
    assert len(facts) == 2
    with pytest.raises(KeyError):
        facts["speed"]


def test_facts_of_a_file_that_is_elsewhere(facts):
    facts.path.write_bytes(PLACEHOLDER + b"mark")
    assert not is_at_hand(facts.path)
    assert dict(facts) == {"log": "a"}
    assert facts.get("tag") is None
    root = str(facts.path.parent)
    shard = Shard("made", "v1", "train", "one", root, (RawItem("file", "", facts),), Options())
    assert Selection({"log": "a"}).of([shard]) == [shard]
    with pytest.raises(BadParameter, match=r"known before reading are file, log, name; .* copy them to a folder"):
        Selection({"tag": "*"}).of([shard])


def test_a_file_that_cannot_be_opened_is_nobody_s_placeholder(facts):
    assert is_at_hand(facts.path)
