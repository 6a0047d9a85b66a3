"""A process that reads damaged lakes, one trial after the other, and prints what came of each as a line of JSON.

python -m tests.scenarionet_data.damage.worker TRIAL FIRST STEP COUNT LAKE...

It first reads the undamaged lakes in every way that it will read the damaged ones. The trial that is about to begin is
printed before it runs: if the process dies, the parent knows of which trial.
"""

from __future__ import annotations

import json
import random
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.errors import ScenarioNetError
from scenarionet_data.storage.integrity import seals
from tests.scenarionet_data.damage import command_lines
from tests.scenarionet_data.damage.harm import harmed, harmed_footer
from tests.scenarionet_data.damage.lakes import Content
from tests.scenarionet_data.damage.readings import READINGS, SHARES, loaded


@dataclass(frozen=True)
class Subject:
    """A lake to damage, and what it holds undamaged.

    Attributes:
        root: Its folder.
        content: Names for command lines.
        whole: Digest of every scenario by id.
        lines: Command lines that succeed on it.
    """

    root: Path
    content: Content
    whole: dict[str, str]
    lines: list[str]


def load(subject: Subject, seed: int) -> str:
    """Load a damaged lake and compare."""
    with harmed(subject.root, seed) as harm:
        try:
            found = loaded(subject.root)
        except ScenarioNetError:
            return "error"
        return "same" if found == subject.whole else f"wrong: {harm}"


def footer(subject: Subject, seed: int) -> str:
    """Read a lake with a damaged footer in one of several ways."""
    how = random.Random(seed).choices(list(SHARES), list(SHARES.values()))[0]
    with harmed_footer(subject.root, seed) as harm, tempfile.TemporaryDirectory() as out:
        try:
            READINGS[how](subject.root, harm.files[0], subject.content, Path(out))
        except ScenarioNetError:
            return f"error {how}"
    return f"same {how}"


def verbs(subject: Subject, seed: int) -> str:
    """Run a command on a copy of a lake that is damaged."""
    line = random.Random(seed).choice(subject.lines)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(shutil.copytree(subject.root, Path(folder) / "lake"))
        with harmed(root, seed) as harm:
            result = command_lines.run(line, root, Path(folder), subject.content)
            # In older lakes, a changed name in a snapshot or in metadata leads to a file that does not exist.
            named = harm.files if subject.content.is_sealed else (*harm.files, "lake/")
            found = command_lines.judged(line, result, named)
        return found if ":" not in found else f"{found} ({harm})"


TRIALS: dict[str, Callable[[Subject, int], str]] = {"load": load, "footer": footer, "verbs": verbs}


def subject_of(root: Path, trial: str) -> Subject:
    """A lake, read in every way of a trial while it is undamaged.

    Raises:
        RuntimeError: A way does not succeed, so that a trial of it would show nothing.
    """
    content = Content.of(root)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        if trial == "footer":
            for reading in READINGS.values():
                reading(root, "metadata/", content, Path(tempfile.mkdtemp(dir=out)))
        lines = command_lines.possible(command_lines.LINES, content) if trial == "verbs" else []
        for line in lines:
            place = Path(tempfile.mkdtemp(dir=out))
            copied = Path(shutil.copytree(root, place / "lake"))
            result = command_lines.run(line, copied, place, content)
            if result.exit_code:
                raise RuntimeError(f"{line!r} fails on {root.name}, undamaged: {result.output} {result.exception!r}")
    return Subject(root, content, loaded(root) if trial == "load" else {}, lines)


def main(trial: str, first: str, step: str, count: str, *lakes: str) -> None:
    """Run trials ``first``, ``first + step``, ... below ``count`` on private copies of lakes."""
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        copies = [Path(shutil.copytree(lake, Path(folder) / str(k) / Path(lake).name)) for k, lake in enumerate(lakes)]
        subjects = [subject_of(root, trial) for root in copies]
        for seed in range(int(first), int(count), int(step)):
            print(json.dumps({"begins": seed}), flush=True)  # noqa: T201
            subject = subjects[seed // int(step) % len(subjects)]
            seals._verified.clear()  # as in a new process
            try:
                found = TRIALS[trial](subject, seed)
            except Exception as error:  # whatever is no sentence is counted
                found = f"traceback: {''.join(traceback.format_exception(error)[-2:])}"
            print(json.dumps({"seed": seed, "lake": subject.root.name, "found": found}), flush=True)  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
