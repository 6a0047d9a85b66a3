"""Cut nuScenes' scenes into scenarios: whole scenes, or windows of the prediction challenge.

The challenge is to predict 6 s of some vehicles at some keyframes, given 2 s of history; they are listed in
``maps/prediction/prediction_scenes.json`` (https://www.nuscenes.org/prediction). Without that file, windows are cut
around every keyframe with its complete past and future in the scene, for moving vehicles.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.converters.nuscenes.recording import NuScenesRecording
from scenarionet_data.converters.nuscenes.types import CATEGORIES
from scenarionet_data.errors import CorruptSource, InvalidScenario
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import make_scenario_id
from scenarionet_data.scenario.vocabulary import ObjectType

_MOVES = 1.0
"""Minimum distance travelled in the future by a moving vehicle [m]."""

Challenge = Mapping[str, Any]
"""``<instance token>_<sample token>`` of each requested prediction, by scene name; lists of text unless damaged."""


@dataclass(frozen=True, eq=False)
class NuScenesWindow:
    """Keyframes ``first`` to ``last`` of a scene: one scenario.

    Attributes:
        recording: The scene.
        first, current, last: Keyframes; the history ends with ``current``.
        targets: Instance tokens of objects to predict.
        is_whole: Whether it is the whole scene.
    """

    recording: NuScenesRecording
    first: int
    current: int
    last: int
    targets: tuple[str, ...] = ()
    is_whole: bool = False

    def id(self, shard: Shard) -> str:
        """Id of its scenario."""
        moment = None if self.is_whole else round(self.recording.times[self.current])
        return make_scenario_id(shard.dataset, shard.version, self.recording.name, moment)


def whole(recording: NuScenesRecording, past: int) -> NuScenesWindow:
    """Return the scene as one window with a history of ``past`` keyframes."""
    last = len(recording.times) - 1
    return NuScenesWindow(recording, 0, min(past, last), last, is_whole=True)


def read_challenge(path: Path) -> Challenge:
    """Read the predictions requested by the challenge.

    Raises:
        CorruptSource: The file is damaged.
    """
    wanted = "expected lists of <instance>_<sample> by scene"
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise CorruptSource(f"{path}: {wanted}, found no JSON; download the map expansion again") from error
    if not isinstance(content, dict):
        raise CorruptSource(f"{path}: {wanted}, found no JSON object; download the map expansion again")
    return content


def challenge_windows(
    recording: NuScenesRecording, past: int, future: int, entries: Sequence[Any], scenario_id: str
) -> Iterator[NuScenesWindow | InvalidScenario]:
    """Return a window around each keyframe in ``entries``, with all of its targets; shorter at the scene's ends.

    An entry that is no text, or has a keyframe that is not in the scene, gives an error in place of its window.
    """
    targets: dict[str, list[str]] = defaultdict(list)
    keyframes = {sample: number for number, sample in enumerate(recording.samples)}
    for entry in entries:
        instance, _, sample = entry.partition("_") if isinstance(entry, str) else ("", "", "")
        targets[sample].append(instance)
    for sample in targets:
        if sample not in keyframes:
            reason = f"expected keyframes of the scene, found {sample[:64]!r}"
            yield InvalidScenario(scenario_id, "prediction_scenes", reason)
    for current in sorted(keyframes[sample] for sample in targets if sample in keyframes):
        last = min(current + future, len(recording.times) - 1)
        asked = tuple(dict.fromkeys(targets[recording.samples[current]]))
        yield NuScenesWindow(recording, max(current - past, 0), current, last, asked)


def moving_windows(recording: NuScenesRecording, past: int, future: int) -> Iterator[NuScenesWindow]:
    """Return a window around each keyframe with complete past and future, for moving vehicles annotated throughout."""
    objects = recording.objects
    is_vehicle = np.array([CATEGORIES.get(word or "") is ObjectType.VEHICLE for word in objects.categories], np.bool_)
    for current in range(past, len(recording.times) - future):
        window, ahead = slice(current - past, current + future + 1), slice(current, current + future + 1)
        step = np.diff(objects.boxes[:, ahead, :2], axis=1)
        is_moving = np.hypot(step[..., 0], step[..., 1]).sum(axis=1) > _MOVES
        chosen = is_vehicle & is_moving & objects.seen[:, window].all(axis=1)
        if chosen.any():
            yield NuScenesWindow(recording, window.start, current, window.stop - 1, tuple(objects.tokens[chosen]))
