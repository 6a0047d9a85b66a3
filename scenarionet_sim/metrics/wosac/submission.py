"""Read and write submissions of WOSAC: ``SimAgentsChallengeSubmission`` messages.

Format: ``waymo_open_dataset/protos/sim_agents_submission.proto`` and protobuf.dev/programming-guides/encoding.
"""

from __future__ import annotations

import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Int64
from scenarionet_data.converters.formats.protobuf import bytes_field, number_field
from scenarionet_data.converters.formats.protowire import DamagedMessage, Fields, Messages, floats, int32s
from scenarionet_data.errors import CorruptSource, SourceNotFound

# Field numbers.
_SCENARIOS, _SUBMISSION_TYPE = 1, 2
_SCENARIO_ID, _SCENES = 1, 2
_TRAJECTORIES = 1
_STATES = (2, 3, 4, 5)  # center_x, center_y, center_z, heading
_OBJECT_ID, _OBJECT_TYPE = 6, 10
_SIZE = (8, 7, 9)  # length, width, height

_SIM_AGENTS = 1


@dataclass(frozen=True, eq=False)
class ScenarioRollouts:
    """Simulations of one scenario: R rollouts of N objects over T steps, in the frame of the source.

    Attributes:
        scenario_id: Id of the scenario in the Waymo Open RolloutMotion Dataset.
        object_ids: (N,) int64, ascending.
        position: (R, N, T, 3) float32 [m] centres.
        heading: (R, N, T) float32 [rad].
        size: (R, N, T, 3) float32 [m] length, width, height; None if the submission has none, as for simulated agents.
    """

    scenario_id: str
    object_ids: Int64
    position: Float32
    heading: Float32
    size: Float32 | None = None


def read_submission(path: str | Path) -> Iterator[ScenarioRollouts]:
    """Read a submission: a binary file, a folder of such files, or a ``.tar.gz`` archive of them.

    Raises:
        SourceNotFound: No such file, or nothing in the folder or archive.
        CorruptSource: A file is not a submission; the message names it.
    """
    for name, content in _contents(Path(path)):
        for message in _scenarios(name, content):
            try:
                yield _parse_rollouts(message)
            except (DamagedMessage, ValueError) as error:
                raise CorruptSource(f"{name}: a damaged submission: {error}") from error


def count_scenarios(path: str | Path) -> int:
    """Number of scenarios in a submission, without decoding them.

    Raises:
        SourceNotFound, CorruptSource: As :func:`read_submission`.
    """
    return sum(len(_scenarios(name, content)) for name, content in _contents(Path(path)))


def write_submission(path: str | Path, scenarios: Iterable[ScenarioRollouts]) -> None:
    """Write rollouts as a submission for the challenge on simulated agents."""
    with Path(path).open("wb") as file:
        for scenario in scenarios:
            parts = [bytes_field(_SCENARIO_ID, scenario.scenario_id.encode())]
            for rollout in range(len(scenario.position)):
                objects = (_trajectory_of(scenario, rollout, row) for row in range(len(scenario.object_ids)))
                parts.append(bytes_field(_SCENES, b"".join(bytes_field(_TRAJECTORIES, each) for each in objects)))
            file.write(bytes_field(_SCENARIOS, b"".join(parts)))
        file.write(number_field(_SUBMISSION_TYPE, _SIM_AGENTS))


# --- reading ----------------------------------------------------------------------------------------------


def _contents(path: Path) -> Iterator[tuple[str, bytes]]:
    """Name and bytes of each file of a submission."""
    if path.is_dir():
        files = sorted(each for each in path.iterdir() if each.is_file())
        if not files:
            raise SourceNotFound(f"{path}: the folder is empty; give the folder, archive or file of a submission")
        yield from ((str(each), each.read_bytes()) for each in files)
    elif not path.is_file():
        raise SourceNotFound(f"{path}: no such file; give the folder, archive or file of a submission")
    elif path.name.endswith((".tar.gz", ".tgz", ".tar")):
        with tarfile.open(path) as archive:
            for member in archive:
                content = archive.extractfile(member) if member.isfile() else None
                if content is not None:
                    yield f"{path}/{member.name}", content.read()
    else:
        yield str(path), path.read_bytes()


def _scenarios(name: str, content: bytes) -> list[Messages]:
    """Message of each scenario in a file."""
    try:
        found = Messages.of(content).fields().parts(_SCENARIOS)
    except DamagedMessage as error:
        raise CorruptSource(f"{name}: not a submission of the sim agents challenge: {error}") from error
    if not len(found):
        raise CorruptSource(f"{name}: not a submission of the sim agents challenge: it has no scenarios")
    return [found[np.array([row])] for row in range(len(found))]


def _parse_rollouts(message: Messages) -> ScenarioRollouts:
    fields = message.fields()
    names = fields.parts(_SCENARIO_ID).contents()
    if not names:
        raise ValueError("expected a scenario id, found none")
    scenario_id = names[-1].decode()
    scenes = fields.parts(_SCENES)
    trajectories = scenes.fields().parts(_TRAJECTORIES)
    count, inner = len(trajectories), trajectories.fields()
    if not count or count % len(scenes) or (np.bincount(trajectories.owner) != count // len(scenes)).any():
        raise ValueError(f"{scenario_id}: expected the same number of objects in each of {len(scenes)} rollouts")
    ids = int32s(inner.column(_OBJECT_ID, "v", count)).reshape(len(scenes), -1)
    order = np.argsort(ids, axis=1, kind="stable")
    ids = np.take_along_axis(ids, order, axis=1)
    if (ids != ids[0]).any() or (np.diff(ids[0]) == 0).any():
        raise ValueError(f"{scenario_id}: expected the same objects in each rollout, each once")
    rows = (order + np.arange(len(scenes))[:, None] * ids.shape[1]).ravel()
    states = [_series(inner, number, count, scenario_id) for number in _STATES]
    steps = {values.shape[1] for values in states}
    if len(steps) > 1 or steps == {0}:
        raise ValueError(f"{scenario_id}: expected x, y, z and heading at the same steps")
    shape = (*ids.shape, steps.pop())
    x, y, z, heading = (values[rows].reshape(shape) for values in states)
    size = None
    if (inner.number == _SIZE[0]).any():
        parts = [_series(inner, number, count, scenario_id) for number in _SIZE]
        if {part.shape[1] for part in parts} != {shape[2]}:
            raise ValueError(f"{scenario_id}: expected length, width and height at each of {shape[2]} steps")
        size = np.stack([part[rows].reshape(shape) for part in parts], axis=-1)
    return ScenarioRollouts(scenario_id, ids[0], np.stack([x, y, z], axis=-1), heading, size)


def _series(fields: Fields, number: int, count: int, scenario_id: str) -> Float32:
    """A repeated field of floats, (count, T)."""
    owner, bits = fields.lists(number, "f")
    lengths = np.bincount(owner, minlength=count)
    if (lengths != lengths[0]).any():
        raise ValueError(f"{scenario_id}: expected the same number of steps for each object")
    return floats(bits).reshape(count, -1)


# --- writing ----------------------------------------------------------------------------------------------


def _trajectory_of(scenario: ScenarioRollouts, rollout: int, row: int) -> bytes:
    """Message of one object in one rollout."""
    states = [*scenario.position[rollout, row].T, scenario.heading[rollout, row]]
    fields = [_floats(number, values) for number, values in zip(_STATES, states, strict=True)]
    fields.append(number_field(_OBJECT_ID, int(scenario.object_ids[row])))
    if scenario.size is not None:
        sizes = scenario.size[rollout, row].T
        fields += [_floats(number, values) for number, values in zip(_SIZE, sizes, strict=True)]
    return b"".join(fields)


def _floats(number: int, values: Float32) -> bytes:
    return bytes_field(number, np.ascontiguousarray(values, "<f4").tobytes())
