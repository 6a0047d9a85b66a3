"""Recordings of rerun as its own reader and verifier see them."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from scenarionet_data import ScenarioLoader
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.files import INDEX
from tests.scenarionet_data.interchange.conformance import WriterConformance, contents


def chunks(path):
    return list(RrdReader(path).stream().to_chunks())


class TestRerun(WriterConformance):
    name = "rerun"

    def contents(self, folder):
        """The files without the ids that rerun draws by chance, which change their sizes, too."""
        found = {}
        for name, content in contents(folder).items():
            if name == INDEX:
                lines = map(json.loads, content.splitlines())
                found[name] = [(line["scenario_id"], sorted(line["files"]), line["losses"]) for line in lines]
            else:
                batches = {chunk.entity_path: chunk.to_record_batch() for chunk in chunks(folder / name)}
                found[name] = {
                    entity: batch.select(batch.schema.names[1:]).to_pydict() for entity, batch in batches.items()
                }
        return found


@pytest.fixture(scope="module")
def scenario(lake):
    return ScenarioLoader(lake)[0]


@pytest.fixture(scope="module")
def file(scenario, tmp_path_factory):
    path = tmp_path_factory.mktemp("rerun") / "x.rrd"
    pictures = {"chase": [b"\xff\xd8"] * scenario.num_timesteps}
    path.write_bytes(writer_for("rerun").write(scenario, "x", Losses(), pictures)["x.rrd"])
    return path


@pytest.fixture(scope="module")
def by_entity(file):
    return {chunk.entity_path: chunk for chunk in chunks(file)}


def column(chunk, name):
    return chunk.to_record_batch().column(name).to_pylist()


def test_boxes_are_where_and_as_large_as_recorded(scenario, by_entity):
    tracks, boxes = scenario.tracks, by_entity["/objects"]
    centers, halves = column(boxes, "Boxes3D:centers"), column(boxes, "Boxes3D:half_sizes")
    turns, names = column(boxes, "Boxes3D:quaternions"), column(boxes, "Boxes3D:labels")
    for timestep in range(scenario.num_timesteps):
        rows = np.flatnonzero(tracks.valid[:, timestep])
        np.testing.assert_array_equal(np.float32(centers[timestep]), tracks.position[rows, timestep])
        np.testing.assert_array_equal(2 * np.float32(halves[timestep]), tracks.size[rows, timestep])
        heading = 2 * np.arctan2(*np.array(turns[timestep])[:, 2:].T)
        np.testing.assert_allclose(np.cos(heading - tracks.heading[rows, timestep]), 1.0, atol=1e-6)
        assert [name.split(" ", 1)[1] for name in names[timestep]] == tracks.ids[rows].tolist()


def test_times_count_from_the_first_timestep(scenario, by_entity):
    times = by_entity["/objects"].to_record_batch().column("time").cast("int64").to_numpy()
    np.testing.assert_array_equal(times, np.round(scenario.timestamps * 1e9).astype(np.int64))


def test_the_ego_has_a_frame_and_the_map_its_lanes(scenario, by_entity):
    translations = np.float32(column(by_entity["/ego"], "Transform3D:translation")).reshape(-1, 3)
    np.testing.assert_array_equal(translations, scenario.tracks.position[scenario.ego_index])
    (lanes,) = column(by_entity["/map/lanes"], "LineStrips3D:strips")
    np.testing.assert_array_equal(np.float32(lanes[0]), scenario.map.polyline[0])


def test_pictures_are_there(scenario, by_entity):
    assert len(column(by_entity["/camera/chase"], "EncodedImage:blob")) == scenario.num_timesteps


def test_the_owner_verifies_it(file):
    program = Path(sys.executable).with_name("rerun")
    done = subprocess.run([program, "rrd", "verify", str(file)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "verified without error" in done.stdout + done.stderr
