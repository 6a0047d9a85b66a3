"""Write scenarios as the Waymo Open Motion Dataset's ``tf.Example``, which Waymax and many models read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.scenes import make_scene
from scenarionet_data.interchange.waymax import features
from scenarionet_data.interchange.waymax.example import encode_record
from scenarionet_data.interchange.waymax.paths import find_paths
from scenarionet_data.scenario.description import ScenarioDescription

_PRECISE = 2.0**14  # [m] coordinates below it keep a millimetre in 32 bits


@dataclass(frozen=True)
class WaymaxWriter:
    """Writes one TFRecord file a scenario; ``cat *.tfrecord`` makes one file of many.

    Positions are those of the source frame, or those of the scenario frame where 32 bits would round the former.

    Attributes:
        points: Points of the road graph: 30,000 in Waymo's releases 1.2 and later, 20,000 before.
        paths: Write the paths that the ego could take, which Waymax reads with ``include_sdc_paths``.
    """

    name: ClassVar[str] = "waymax"

    points: int = 30_000
    paths: bool = True

    def __post_init__(self) -> None:
        if not 0 < self.points <= 1_000_000:
            raise BadParameter(f"points={self.points}: wanted a number from 1 to 1,000,000")

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the file of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        scene = make_scene(scenario, losses, features.KINDS)
        is_far = bool(np.abs(scenario.origin[:2]).max() >= _PRECISE)
        losses.leave_out("origins of source frames, too far away for 32 bits", int(is_far))
        shift = -scenario.origin if is_far else np.zeros(3)
        found = (
            features.objects(scenario, scene, shift, losses)
            | features.lights(scenario, scene, shift, losses)
            | features.road_graph(scenario, scene, shift, self.points, losses)
            | (find_paths(scenario.map, scene, shift, losses) if self.paths else {})
        )
        text = {"scenario/id": scenario.source.scenario_id.encode()}
        stem = stem.replace("@", "_at_")  # Waymax takes what follows an @ for a number of files
        return {f"{stem}.tfrecord": encode_record({**found, **text})}
