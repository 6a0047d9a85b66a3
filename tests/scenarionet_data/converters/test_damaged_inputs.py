"""Hundreds of damaged inputs of Argoverse 1 and Waymo: each gives scenarios or a message of ours, never a traceback."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import SourceError
from tests.fixtures import argoverse1, waymo

NUM_TRIALS = 240

RAW_MESSAGE = re.compile(
    r"Error\b|Traceback|unhashable|Expected bytes|object has no attribute|not subscriptable|invalid literal|"
    r"could not convert|index \d+ is out of bounds|list index|NoneType|cannot be broadcast|CSV parse|CSV conversion"
)
"""Words of Python, NumPy and Arrow that no message should consist of."""

Damage = Callable[[bytes, np.random.Generator], bytes]


def flip(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for place in rng.integers(0, max(len(data), 1), rng.integers(1, 9)):
        changed[place : place + 1] = bytes([changed[place] ^ (1 << rng.integers(8))] if place < len(data) else [])
    return bytes(changed)


def cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(0, len(data) + 1)]


def remove(data: bytes, rng: np.random.Generator) -> bytes:
    first = int(rng.integers(0, len(data) + 1))
    return data[:first] + data[first + int(rng.integers(1, 400)) :]


def insert(data: bytes, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(0, len(data) + 1))
    return data[:place] + rng.bytes(int(rng.integers(1, 60))) + data[place:]


def fill(data: bytes, rng: np.random.Generator) -> bytes:
    return rng.choice([b"", b"\0" * 300, b"\xff" * 300, b"null", b"[]", b"PK\x03\x04" * 9, b"a,b\n1,2\n"]).tobytes()


WORDS = [b"", b"nan", b"null", b"inf", b"1e999", b"-0", b"x", b"\xff\xfe", b"9" * 400, b"\xd9\xa3", b'"', b"\r", b"{}"]


def replace_cell(data: bytes, rng: np.random.Generator) -> bytes:
    """Another word in a few cells of a CSV file, or attributes of an XML file."""
    parts = re.split(rb'([,\n"])', data)
    for place in rng.integers(0, len(parts), rng.integers(1, 30)):
        if parts[place] not in (b",", b"\n", b'"'):
            parts[place] = WORDS[rng.integers(len(WORDS))]
    return b"".join(parts)


def drop_column(data: bytes, rng: np.random.Generator) -> bytes:
    column = rng.integers(6)
    rows = [line.split(b",") for line in data.splitlines()]
    return b"\n".join(b",".join(cells[:column] + cells[column + 1 :]) for cells in rows)


TEXT: list[Damage] = [flip, cut, remove, insert, fill, replace_cell, replace_cell, drop_column]
BYTES: list[Damage] = [flip, cut, remove, insert, fill]


def in_message(damage: Damage) -> Damage:
    """Damage in the message of the first record, with checksums that are right: hostile, not by accident."""

    def changed(data: bytes, rng: np.random.Generator) -> bytes:
        length = int.from_bytes(data[:8], "little")
        return waymo.frame(damage(data[12 : 12 + length], rng)) + data[16 + length :]

    return changed


def outcome(dataset: str, raw: Path, lake: Path, options: dict) -> list[str]:
    """Messages of a conversion: of its failure, of failed shards and of quarantined scenarios."""
    try:
        report = convert(dataset, raw, lake, split="train", options=options)
    except SourceError as error:
        return [str(error)]
    messages = [str(failed) for failed in report.failed]
    if report.quarantined:
        messages += Lake(lake).sql("SELECT message FROM quarantine")["message"].to_list()
    return messages


def faults(dataset: str, raw: Path, folder: Path, files: list[str], damages: list[Damage], options: dict) -> list[str]:
    """What was raised that is no error of ours, and messages that are not."""
    wrong = []
    for number in range(NUM_TRIALS):
        rng = np.random.default_rng(number)
        copy = folder / f"raw-{number}"
        shutil.copytree(raw, copy)
        target = copy / files[number % len(files)]
        damage = damages[(number // len(files)) % len(damages)]
        if number % 40 == 39:
            target.unlink()
            target.mkdir()
        else:
            target.write_bytes(damage(target.read_bytes(), rng))
        try:
            messages = outcome(dataset, copy, folder / f"lake-{number}", options)
        except Exception as error:  # what the test is about
            wrong.append(f"{number}: {damage.__name__} of {target.name}: {type(error).__name__}: {error}")
        else:
            wrong += [f"{number}: {damage.__name__} of {target.name}: {m}" for m in messages if RAW_MESSAGE.search(m)]
        shutil.rmtree(copy)
        shutil.rmtree(folder / f"lake-{number}", ignore_errors=True)
    return wrong


@pytest.mark.long
def test_argoverse1(tmp_path: Path) -> None:
    argoverse1.write_recordings(tmp_path / "raw" / "train", 2)
    map_path = argoverse1.write_map(tmp_path / "raw")
    assert faults("argoverse1", tmp_path / "raw", tmp_path, ["train/1.csv", map_path.name], TEXT, {}) == []


@pytest.mark.long
def test_waymo(tmp_path: Path) -> None:
    name = "training.tfrecord-00000-of-00001"
    payloads = [waymo.scenario_bytes(seed, num_steps=21, num_rows=2, spacing=5.0) for seed in range(2)]
    waymo.write_tfrecord(tmp_path / "raw" / name, payloads)
    damages = [*BYTES, *map(in_message, BYTES)]
    assert faults("waymo", tmp_path / "raw", tmp_path, [name], damages, {}) == []
