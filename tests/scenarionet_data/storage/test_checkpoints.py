"""Checkpoints: the format of the package safetensors, damage found everywhere, one writer, and older files."""

from __future__ import annotations

import numpy as np
import pytest
from xxhash import xxh3_128_hexdigest

from scenarionet_data.errors import LakeError
from scenarionet_data.storage import checkpoints
from scenarionet_data.storage.checkpoints import Checkpoint, decode, encode
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.integrity import seals

ARRAYS = {
    "weights": np.arange(6, dtype=np.float32).reshape(2, 3),
    "steps": np.float32(3.0),
    "state": np.arange(5, dtype=np.uint8),
    "none": np.zeros((0, 4)),
    "flags": np.array([True, False]),
}


def test_arrays_are_read_back():
    found = decode(encode(ARRAYS))[0]
    assert list(found) == sorted(ARRAYS)
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(found[name], values)
        assert found[name].dtype == np.asarray(values).dtype and found[name].shape == np.shape(values)


def test_the_package_reads_and_writes_the_same():
    safetensors = pytest.importorskip("safetensors.numpy")
    for name, values in safetensors.load(encode(ARRAYS)).items():
        np.testing.assert_array_equal(values, ARRAYS[name])
    arrays = {name: np.asarray(values) for name, values in ARRAYS.items()}
    for name, values in decode(safetensors.save(arrays))[0].items():
        np.testing.assert_array_equal(values, ARRAYS[name])


@pytest.fixture
def files(tmp_path):
    return open_files(tmp_path)


def assert_equal(found, number, facts):
    assert found.number == number and facts.items() <= found.facts.items() and list(found.arrays) == sorted(ARRAYS)
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(found.arrays[name], values)


def test_the_newest_ones_are_kept_and_strangers_ignored(files, tmp_path):
    for number in (1, 2, 3):
        checkpoints.save(files, "run", Checkpoint(number, {"steps": 10 * number}, ARRAYS))
    folder = tmp_path / "results" / "run" / "checkpoints"
    (folder / "notes.json").write_text("mine")
    assert checkpoints.numbers(files, "run") == [2, 3]
    assert_equal(checkpoints.load(files, "run"), 3, {"steps": 30})
    assert checkpoints.load(files, "run", 1) is None and checkpoints.load(files, "other") is None
    checkpoints.verify(files, "run")


def test_the_package_reads_a_checkpoint(files, tmp_path):
    safetensors = pytest.importorskip("safetensors.numpy")
    checkpoints.save(files, "run", Checkpoint(1, {"steps": 7}, ARRAYS))
    found = safetensors.load_file(tmp_path / "results/run/checkpoints/checkpoint-000001.safetensors")
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(found[name], values)


@pytest.mark.parametrize("number", [1, 2])
def test_a_number_belongs_to_the_first_writer(files, number):
    for taken in (1, 2):
        checkpoints.save(files, "run", Checkpoint(taken, {"steps": 0}, ARRAYS))
    with pytest.raises(LakeError, match="another process"):
        checkpoints.save(files, "run", Checkpoint(number, {"steps": 1}, {}))
    assert_equal(checkpoints.load(files, "run", number), number, {"steps": 0})


def test_each_damaged_byte_is_found(files, tmp_path):
    checkpoints.save(files, "run", Checkpoint(1, {"steps": 7}, {"weights": np.arange(3, dtype=np.float32)}))
    path = tmp_path / "results/run/checkpoints/checkpoint-000001.safetensors"
    whole = path.read_bytes()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(LakeError, match="damaged checkpoint"):
            checkpoints.verify(files, "run")
    path.write_bytes(whole[:-1])
    with pytest.raises(LakeError, match="damaged checkpoint"):
        checkpoints.verify(files, "run")
    path.rename(path.with_name("checkpoint-000002.safetensors"))
    with pytest.raises(LakeError, match="damaged checkpoint"):
        checkpoints.load(files, "run", 2)


def test_checkpoints_of_two_files_stay_readable(files, tmp_path):
    folder = tmp_path / "results" / "run" / "checkpoints"
    folder.mkdir(parents=True)
    data = encode(ARRAYS)
    (folder / "000004.safetensors").write_bytes(data)
    facts = {"steps": 40, "number": 4, "tensors": xxh3_128_hexdigest(data)}
    (folder / "000004.json").write_bytes(
        seals.seal_json(facts, files.place_to_write("results/run/checkpoints/000004.json"))
    )
    (folder / "000005.safetensors").write_bytes(data)  # of a process that was killed before the second file
    assert checkpoints.numbers(files, "run") == [4]
    assert_equal(checkpoints.load(files, "run"), 4, {"steps": 40})
    checkpoints.verify(files, "run")
    checkpoints.save(files, "run", Checkpoint(5, {"steps": 50}, ARRAYS), keep=1)
    assert checkpoints.numbers(files, "run") == [5]
    assert sorted(path.name for path in folder.iterdir()) == ["000005.safetensors", "checkpoint-000005.safetensors"]
    assert_equal(checkpoints.load(files, "run"), 5, {"steps": 50})
    (folder / "checkpoint-000005.safetensors").unlink()
    (folder / "000004.safetensors").write_bytes(data[:-1] + b"9")
    (folder / "000004.json").write_bytes(
        seals.seal_json(facts, files.place_to_write("results/run/checkpoints/000004.json"))
    )
    with pytest.raises(LakeError, match="damaged checkpoint"):
        checkpoints.verify(files, "run")
