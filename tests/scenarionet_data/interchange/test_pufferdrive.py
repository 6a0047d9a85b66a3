"""PufferDrive's maps, encoded, decoded and damaged."""

import struct

import numpy as np
import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.errors import BadParameter, CorruptSource
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.pufferdrive.layout import LANE, VEHICLE, Entity, PufferMap, decode, encode
from scenarionet_data.interchange.pufferdrive.writer import simplified
from tests.scenarionet_data.interchange.conformance import WriterConformance


def small_map() -> PufferMap:
    line = np.arange(6, dtype=np.float32).reshape(2, 3)
    moving = Entity(
        VEHICLE, 7, line, line + 1, np.array([0.5, 0.25], np.float32), np.array([True, False]), (2.0, 4.0, 1.5),
        (1.0, 2.0, 3.0), True,
    )  # fmt: skip
    return PufferMap([moving], [Entity(LANE, 9, line)], 0, (0,))


class TestPufferDrive(WriterConformance):
    name = "pufferdrive"

    @pytest.mark.parametrize("layout", [1, 2])
    def test_written_maps_are_read_back(self, lake, layout):
        scenario = ScenarioLoader(lake)[1]
        (content,) = (
            writer_for("pufferdrive", {"layout": layout, "simplify": False}).write(scenario, "m", Losses()).values()
        )
        read = decode(content, layout, "m.bin")
        ego = read.objects[read.ego if layout == 2 else 0]
        row, first = scenario.ego_index, scenario.current_timestep - 10
        valid = scenario.tracks.valid[row, first : first + 91]
        expected = scenario.tracks.position[row, first : first + 91] + scenario.origin
        np.testing.assert_allclose(ego.position[valid], expected[valid], atol=1e-3)
        np.testing.assert_array_equal(ego.valid, valid)
        assert ego.kind == VEHICLE
        assert len(read.roads) > 0


def test_layout_1_by_hand():
    expected = struct.pack("<2i", 1, 1) + struct.pack("<2i", 1, 2) + struct.pack("<6f", 0, 3, 1, 4, 2, 5)
    expected += struct.pack("<6f", 1, 4, 2, 5, 3, 6) + struct.pack("<2f2i", 0.5, 0.25, 1, 0)
    expected += struct.pack("<6fi", 2.0, 4.0, 1.5, 1.0, 2.0, 3.0, 1)
    expected += (
        struct.pack("<2i", 4, 2) + struct.pack("<6f", 0, 3, 1, 4, 2, 5) + struct.pack("<6fi", 0, 0, 0, 0, 0, 0, 0)
    )
    assert encode(small_map(), 1) == expected


@pytest.mark.parametrize("layout", [1, 2])
def test_damage_is_a_sentence(layout):
    content = encode(small_map(), layout)
    for length in range(len(content)):
        with pytest.raises(CorruptSource, match="at byte"):
            decode(content[:length], layout, "map.bin")
    with pytest.raises(CorruptSource, match="expected the end"):
        decode(content + b"\0", layout, "map.bin")
    with pytest.raises(CorruptSource):
        decode(content, 3 - layout, "map.bin")
    with pytest.raises(BadParameter, match="layouts 1 and 2"):
        writer_for("pufferdrive", {"layout": 3})


def test_simplified_lines_keep_corners_and_ends():
    straight = np.stack([np.linspace(0, 100, 41), np.zeros(41), np.zeros(41)], axis=1)
    corner = np.concatenate([straight, straight[1:, [1, 0, 2]] + [100, 0, 0]])
    kept = simplified(corner)
    assert kept.tolist() == [[0, 0, 0], [100, 0, 0], [100, 100, 0]]


def test_recorded_map_is_encoded_to_the_same_bytes(recordings):
    content = (recordings / "exchange" / "pufferdrive_bin" / "map_942.bin").read_bytes()
    assert encode(decode(content, 1, "map_942.bin"), 1) == content
