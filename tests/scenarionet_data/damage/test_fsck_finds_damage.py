"""Every changed byte of every file is found by a deep fsck, which never ends in an error itself."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from scenarionet_data import Lake
from scenarionet_data.maintenance import compact, fsck, upgrade
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.lake_files import IDENTITY
from tests.fixtures import made, made_city
from tests.scenarionet_data.storage.test_evaluation_runs import publish

GOLDEN = Path(__file__).parents[2] / "golden" / "lakes" / "format-1"
LAKES = ("current", "generated", "recorded", "packed")
TRIALS = {"current": 1600, "generated": 800, "recorded": 150, "packed": 650}

Change = Callable[[random.Random, bytes], bytes]


def write_current(root: Path) -> None:
    """Shards with quarantine, a shared map, replaced shards, compacted ones, databases, user columns and runs."""
    raw = root.parent / "raw"
    made.run(
        made.write_raw(raw / "a", {"a": [1, "2 invalid"], "b": [3, 4]}), root, options=made.MadeOptions(num_objects=2)
    )
    made.run(made.write_raw(raw / "c", {"c": [5, 6]}), root, made_city.NAME)
    lake = Lake(root)
    lake.tag_where("odd", "num_objects % 2 = 1")
    lake.refresh().filter("odd OR NOT odd", name="first")
    made.run(made.write_raw(raw / "a", {"a": [1, 7]}), root, options=made.MadeOptions(num_objects=2), replace=True)
    compact(root, "analytics", where={"dataset": made.NAME})
    lake = Lake(root)
    lake.filter(name="all")
    lake.filter("num_objects > 1", name="all", replace=True)
    for name in ("one", "other"):
        run = evaluation_runs.claim(lake.files, name, ("rollouts", "results"), {"policy": name})
        for part, scenario_id in enumerate(lake.database("all").scenario_ids[:2]):
            publish(run, part, scenario_id, cost=part)


@pytest.fixture(scope="module", params=LAKES)
def root(request, tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp(request.param) / "lake"
    if request.param == "current":
        write_current(root)
    else:
        shutil.copytree(GOLDEN / request.param / "lake", root)
        assert upgrade(root).is_complete
    found = fsck(root, is_deep=True)
    assert (found.problems, found.unsealed, found.notes) == ((), (), ())
    return root


def flip(rng: random.Random, data: bytes) -> bytes:
    """Change one bit."""
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def flip_near_the_end(rng: random.Random, data: bytes) -> bytes:
    """Change one bit of the last 100 bytes: length of the footer, seals, digests."""
    at = len(data) - 1 - rng.randrange(min(100, len(data)))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def overwrite(rng: random.Random, data: bytes) -> bytes:
    """Replace one byte by any other one."""
    at = rng.randrange(len(data))
    return data[:at] + bytes([(data[at] + rng.randrange(1, 256)) % 256]) + data[at + 1 :]


def cut(rng: random.Random, data: bytes) -> bytes:
    """Keep the first bytes only."""
    return data[: rng.randrange(len(data))]


def zero(rng: random.Random, data: bytes) -> bytes:
    """Overwrite a block with zeros, as after a power failure."""
    start = rng.randrange(len(data))
    end = min(len(data), start + rng.choice([16, 512, 4096]))
    return data[:start] + bytes(end - start) + data[end:]


CHANGES: tuple[Change, ...] = (flip, flip, flip, flip_near_the_end, overwrite, cut, zero)


@contextmanager
def changed(contents: dict[Path, bytes]) -> Iterator[None]:
    """Files with other contents, restored afterwards."""
    before = {path: path.read_bytes() for path in contents}
    for path, data in contents.items():
        path.write_bytes(data)
    try:
        yield
    finally:
        for path, data in before.items():
            path.write_bytes(data)


def files_of(root: Path) -> list[Path]:
    """All files of a lake; none is unused. The checksums of a pack are checked by ``scenarionet pack --verify``."""
    found = (path for path in root.rglob("*") if path.is_file() and ".tmp" not in path.parts)
    return sorted(path for path in found if path.name != "SHA256SUMS")


def kind_of(path: Path, root: Path) -> tuple[str, str]:
    """Files of one kind may be exchanged by mistake."""
    parts = path.relative_to(root).parts
    return parts[-2] if parts[0] == "results" else parts[0], path.suffix


@pytest.mark.damage
def test_every_change_of_a_byte_is_found(root, request):
    trials = TRIALS[request.node.callspec.params["root"]]
    rng = random.Random(trials)
    missed = []
    names = files_of(root)
    for trial in range(trials):
        path = names[trial % len(names)]
        change = rng.choice(CHANGES)
        data = path.read_bytes()
        other = change(rng, data)
        if other == data:
            continue
        with changed({path: other}):
            name = path.relative_to(root).as_posix()
            if name not in {problem.file for problem in fsck(root, is_deep=True, workers=1).problems}:
                missed.append((name, change.__name__))
    assert missed == []
    assert fsck(root, is_deep=True).is_whole


@pytest.mark.damage
def test_every_exchange_of_two_files_is_found(root, request):
    rng = random.Random(7)
    names, missed = files_of(root), []
    pairs = [(one, other) for k, one in enumerate(names) for other in names[k + 1 :]
             if kind_of(one, root) == kind_of(other, root) and one.read_bytes() != other.read_bytes()]  # fmt: skip
    for one, other in rng.sample(pairs, min(len(pairs), TRIALS[request.node.callspec.params["root"]] // 5)):
        with changed({one: other.read_bytes(), other: one.read_bytes()}):
            found = {problem.file for problem in fsck(root, is_deep=True, workers=1).problems}
            missed += [path for path in (one, other) if path.relative_to(root).as_posix() not in found]
    assert missed == []


@pytest.mark.damage
def test_fsck_goes_on_past_whatever_is_in_place_of_a_file(root):
    """A folder, JSON that is hostile, not UTF-8, of other types; a second damaged file is found as well."""
    names = files_of(root)
    tracks = next(path for path in names if "tracks" in path.relative_to(root).parts[0])
    hostile = [b"", b"{}", b"[]", b"null", b"\xff\xfe", b"[" * 100_000, b'{"format": 2, "digest": 1e999}', b"PAR1" * 8,
               b'{"format": 1, "number": "x", "metadata": 3, "manifests": {}}', b'{"tables": 7}']  # fmt: skip
    for path in names:
        name = path.relative_to(root).as_posix()
        is_json = path.suffix == ".json"
        for data in hostile if is_json else (b"", b"PAR1PAR1" * 9):
            broken = bytes([tracks.read_bytes()[0] ^ 1]) + tracks.read_bytes()[1:]
            with changed({path: data} | ({} if path == tracks else {tracks: broken})):
                found = {problem.file for problem in fsck(root, is_deep=True, workers=1).problems}
            is_read_on = "snapshots/" not in name and name != IDENTITY  # every seal covers the id of the lake
            assert name in found
            assert not is_read_on or tracks.relative_to(root).as_posix() in found
        content = path.read_bytes()
        path.unlink()
        path.mkdir()
        assert name in {problem.file for problem in fsck(root, is_deep=True, workers=1).problems}
        path.rmdir()
        path.write_bytes(content)
