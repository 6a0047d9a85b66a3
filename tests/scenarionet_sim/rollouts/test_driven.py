"""Runs as scenarios, and exports of them with pictures."""

import numpy as np
import polars as pl
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.mcap.writer import McapWriter
from scenarionet_sim import evaluate
from scenarionet_sim.render.pictured import WithPictures
from scenarionet_sim.render.rollouts import read_rollout
from scenarionet_sim.render.space import Film
from scenarionet_sim.rollouts.driven import DrivenScenarios

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    folder = str(tmp_path_factory.mktemp("driven") / "lake")
    convert("pg", "5:7", folder)
    evaluate(folder, policy="constant", name="straight")
    return folder


def driven(lake, **options):
    return DrivenScenarios(ScenarioLoader(lake), lake, "straight", **options)


def test_a_run_replaces_the_recording(lake):
    scenario, recorded = driven(lake)[0], ScenarioLoader(lake)[0]
    scenario.validate()
    ego = scenario.ego_index
    (row,) = (
        Lake(lake)
        .sql(
            "SELECT x, vy, heading, start FROM rollouts WHERE run = 'straight' AND scenario_id = $id AND is_judged",
            {"id": recorded.id},
        )
        .rows()
    )
    steps = slice(row[3], min(row[3] + len(row[0]), scenario.num_timesteps))
    seen = scenario.tracks.valid[ego, steps]
    np.testing.assert_array_equal(scenario.tracks.position[ego, steps, 0], np.float32(row[0])[: len(seen)] * seen)
    np.testing.assert_array_equal(scenario.tracks.velocity[ego, steps, 1], np.float32(row[1])[: len(seen)] * seen)
    assert np.abs(scenario.tracks.position[ego, -1] - recorded.tracks.position[ego, -1]).max() > 1.0
    np.testing.assert_array_equal(scenario.tracks.position[:, : row[3]], recorded.tracks.position[:, : row[3]])


def test_objects_are_gone_after_the_end_of_an_episode(lake, monkeypatch):
    def cut(*asked):
        lists = pl.col("x", "y", "heading", "vx", "vy", "valid").list.head(20)
        return read_rollout(*asked).with_columns(lists)

    monkeypatch.setattr("scenarionet_sim.rollouts.driven.read_rollout", cut)
    scenario = driven(lake)[0]
    scenario.validate()
    start = read_rollout(Lake(lake), "straight", scenario.id)["start"][0]
    assert scenario.tracks.valid[scenario.ego_index, : start + 20].all()
    assert not scenario.tracks.valid[scenario.ego_index, start + 20 :].any()


def test_its_vehicle_beside_the_recording(lake):
    scenario, recorded = driven(lake, beside=True)[0], ScenarioLoader(lake)[0]
    scenario.validate()
    assert scenario.tracks.ids[-1] == f"straight:{recorded.ego_id}"
    np.testing.assert_array_equal(scenario.tracks.position[:-1], recorded.tracks.position)
    np.testing.assert_array_equal(scenario.tracks.position[-1], driven(lake)[0].tracks.position[scenario.ego_index])
    np.testing.assert_array_equal(scenario.tracks.size[-1, -1], recorded.tracks.size[recorded.ego_index, -1])


def test_a_run_that_is_not_there(lake):
    with pytest.raises(BadParameter, match=r"run 'other' has no rollout 0 of .*; runs in this lake: straight"):
        DrivenScenarios(ScenarioLoader(lake), lake, "other")[0]


def test_every_timestep_has_a_picture_of_each_view(lake):
    scenario = ScenarioLoader(lake)[0]
    writer = WithPictures(writer_for("mcap"), (Film("chase", 64, 36), Film("camera", 64, 36)))
    files = writer.write(scenario, "x", Losses())
    assert len(files["x.mcap"]) > len(McapWriter().write(scenario, "x", Losses())["x.mcap"])
    from io import BytesIO

    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory
    from PIL import Image

    reader = make_reader(BytesIO(files["x.mcap"]), decoder_factories=[DecoderFactory()])
    images = [m.data for _, _, _, m in reader.iter_decoded_messages(topics=["/camera/chase"])]
    assert len(images) == scenario.num_timesteps
    first, later = (np.asarray(Image.open(BytesIO(image))) for image in (images[0], images[40]))
    assert first.shape == (36, 64, 3)
    assert (first != later).any()
