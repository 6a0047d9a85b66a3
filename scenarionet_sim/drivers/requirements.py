"""Environments of policies, each made of a requirements file once and kept in the user's cache."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from scenarionet_data import version
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.storage.files.cache import folder_of

SUFFIX = ".txt"
"""Of a requirements file; an interpreter has another name."""

_PIP = ("-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check", "--requirement")


def made_interpreter(python: str) -> str:
    """Return an interpreter unchanged, and for a requirements file that of an environment with what it asks for.

    The packages of the running environment, this software among them, come after those that are asked for. A file of
    other content is another environment; what the file refers to is not compared.

    Args:
        python: An interpreter, a requirements file (``.txt``), or empty.

    Raises:
        SourceNotFound: There is no such requirements file.
        BadParameter: No environment can be made of it.
    """
    if not python.endswith(SUFFIX):
        return python
    file, packages = Path(python).absolute(), sysconfig.get_path("purelib")
    if not file.is_file():
        raise SourceNotFound(f"{python}: there is no requirements file {file}")
    parts = (file.read_bytes(), sys.version.encode(), version.name_and_version().encode(), packages.encode())
    folder = folder_of("environments") / hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".") as draft:  # moved when it is complete
            root = f"{draft}/environment"
            for words in ([sys.executable, "-m", "venv", root], [_python_in(root), *_PIP, str(file)]):
                done = subprocess.run(words, capture_output=True, cwd=file.parent, check=False)  # noqa: S603 - asked for
                if done.returncode:
                    told = done.stderr.decode(errors="replace").splitlines() or [f"exit status {done.returncode}"]
                    told = [line for line in told if line.startswith("ERROR")] or told
                    raise BadParameter(f"{file}: no environment can be made of it: {told[-1]}")
            own = sysconfig.get_path("purelib", "venv", vars={"base": root})
            Path(own, "of_scenarionet.pth").write_text(f"import site; site.addsitedir({packages!r})\n", "utf-8")
            try:
                Path(root).rename(folder)
            except OSError:  # another process was faster
                if not folder.is_dir():
                    raise
    return _python_in(str(folder))


def _python_in(root: str) -> str:
    return str(Path(sysconfig.get_path("scripts", "venv", vars={"base": root}), "python"))
