"""Code of policies that run in a process of their own: of a commit, of a file, or in another environment.

``git:REF:module:Class`` and ``module:Class@REF`` are of a commit of the repository in the current folder, which is
written once to a cache; ``folder/file.py:Class`` is of a file. Pinned, as a run stores them, they have the commit and
the folder in it that modules are imported from, ``git:COMMIT:folder/module:Class``, or the whole path of the file.
"""

from __future__ import annotations

import hashlib
import io
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.storage.files.cache import folder_of
from scenarionet_sim.bridges.commonroad.by_name import is_outside
from scenarionet_sim.bridges.driver.containers import is_container, pinned_image
from scenarionet_sim.bridges.driver.planner import is_driver
from scenarionet_sim.bridges.stacks import is_stack

PREFIX = "git:"
AGENT = "carla:"
"""Before a file of an agent of CARLA's leaderboard, which ``bridges.carla`` makes a planner of."""


@dataclass(frozen=True)
class PolicyCode:
    """A class, and where it is imported from.

    Attributes:
        reference: ``module:Class``.
        folder: First on the import path.
        root: Folder of the commit; of a file, that of the file.
    """

    reference: str
    folder: Path
    root: Path

    @classmethod
    def of(cls, policy: str) -> PolicyCode | None:
        """Return the code of a pinned policy; None for one that is imported in this process.

        Raises:
            SourceNotFound: Its commit is not in the cache, and not in the repository of the current folder.
        """
        if not is_apart(policy):
            return None
        root, place = Path("/"), policy.removeprefix(AGENT)
        if policy.startswith(PREFIX):
            commit, _, place = policy.removeprefix(PREFIX).partition(":")
            root = _checkout(commit)
        path, _, name = place.rpartition(":")
        folder, _, module = path.rpartition("/")
        where = root / folder
        return cls(f"{module.removesuffix('.py')}:{name}", where, where if root == Path("/") else root)


def is_apart(policy: str) -> bool:
    """Return whether a policy is imported in a process of its own.

    Example:
        >>> is_apart("git:main:my_planner:Mine"), is_apart("mine.py:Mine"), is_apart("my_planner:Mine")
        (True, True, False)
    """
    return policy.startswith(PREFIX) or ".py:" in policy


def pinned_code(policy: str) -> str:
    """Return a policy with the commit for its reference, the id of its image, or a whole path; others unchanged.

    Raises:
        BadParameter: It lacks its parts.
        SourceNotFound: There is no repository, no such commit, file or image, no git, or no runtime of containers.
    """
    if is_container(policy):
        return pinned_image(policy)
    if ":" in policy and "@" in policy.rpartition(":")[2] and not policy.startswith(PREFIX):
        place, _, ref = policy.rpartition("@")
        policy = f"{PREFIX}{ref}:{place}"
    if policy.startswith(PREFIX):
        ref, _, place = policy.removeprefix(PREFIX).partition(":")
        path, _, name = place.rpartition(":")
        if not (ref and path and name):
            raise BadParameter(f"{policy}: expected git:REF:module:Class, such as git:main:my_planner:MyPlanner")
        commit = _git("rev-parse", "--verify", "--quiet", f"{ref}^{{commit}}", lacking=f"no commit {ref!r}")
        prefix = "" if len(ref) == len(commit) else _git("rev-parse", "--show-prefix", lacking="no working tree")
        return f"{PREFIX}{commit}:{prefix}{path}:{name}"
    if is_apart(policy):
        path, _, name = policy.removeprefix(AGENT).rpartition(":")
        file = Path(path).absolute()
        if not file.is_file():
            raise SourceNotFound(f"{policy}: there is no file {file}")
        return f"{AGENT if policy.startswith(AGENT) else ''}{file}:{name}"
    if policy.startswith(AGENT):
        raise BadParameter(f"{policy}: expected carla:folder/agent.py:Class")
    return policy


def interpreter_of(policy: str, python: str = "") -> str:
    """Return the interpreter of a policy; of ``module:Class`` at least another process of the one that runs now."""
    is_elsewhere = is_stack(policy) or is_driver(policy) or is_outside(policy) or is_apart(policy)
    return python or (sys.executable if ":" in policy and not is_elsewhere else "")


def policy_name(policy: str) -> str:
    """Return a policy for names of runs: of one that runs apart the class, and eight digits of its commit or image.

    Example:
        >>> policy_name("git:0123456789abcdef:planners/mine:Mine"), policy_name("/home/me/mine.py:Mine")
        ('mine.Mine-01234567', 'mine.Mine')
    """
    if is_apart(policy):
        path, _, name = policy.rpartition(":")
        commit = policy.removeprefix(PREFIX)[:8] if policy.startswith(PREFIX) else ""
        module = path.rpartition("/")[2].rpartition(":")[2].removesuffix(".py")
        policy = "-".join(filter(None, [f"{module}.{name}", commit]))
    if is_container(policy):
        runtime, _, image = policy.partition(":")
        policy = f"{runtime}-{image.removeprefix('sha256:')[:8]}"
    return policy


def code_digest(folder: Path) -> str:
    """Return a digest of the files below a folder that this process has imported."""
    files = {Path(file) for each in list(sys.modules.values()) if (file := getattr(each, "__file__", None))}
    own = sorted(file for file in files if file.is_relative_to(folder) and file.is_file())
    digest = hashlib.sha256()
    for file in own:
        digest.update(f"{file.relative_to(folder)}\n".encode() + file.read_bytes())
    return digest.hexdigest()[:12]


def _checkout(commit: str) -> Path:
    """The files of a commit, in the cache."""
    folder = folder_of("commits") / commit
    if not folder.is_dir():
        top = _git("rev-parse", "--show-toplevel", lacking=f"no commit {commit}, nor {folder}")
        content = _run("-C", top, "archive", "--format=tar", commit, lacking=f"no commit {commit}")
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".") as draft:
            with tarfile.open(fileobj=io.BytesIO(content)) as archive:
                archive.extractall(f"{draft}/files", filter="data")
            try:
                Path(draft, "files").rename(folder)
            except OSError:  # another process was faster
                if not folder.is_dir():
                    raise
    return folder


def _git(*words: str, lacking: str) -> str:
    return _run(*words, lacking=lacking).decode().strip()


def _run(*words: str, lacking: str) -> bytes:
    """Output of git in the current folder."""
    try:
        done = subprocess.run(["git", *words], capture_output=True, check=True)  # noqa: S603, S607 - the user's own git
    except FileNotFoundError as error:
        raise SourceNotFound("git is not installed; install it, or name a file.py:Class") from error
    except subprocess.CalledProcessError as error:
        told = error.stderr.decode(errors="replace").strip().partition("\n")[0]
        raise SourceNotFound(
            f"{Path.cwd()}: {lacking}{f' ({told})' if told else ''}; go to the repository of the policy, or fetch it"
        ) from error
    return done.stdout
