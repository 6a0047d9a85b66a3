"""Drivers in containers, by name: ``docker:IMAGE`` and ``podman:IMAGE``.

A process starts one container of an image that is on this machine, without a network. It gets the path of a socket as
its last word, binds it, and answers there as any driver does.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
import uuid
from pathlib import Path

from scenarionet_data.errors import BadParameter, SourceError, SourceNotFound

RUNTIMES = ("docker", "podman")
"""Programs that run containers, and prefixes of policies."""

START = 60.0
"""Longest time until a container has bound its socket [s]."""

_FOLDER = "/driver"  # in the container


def is_container(policy: str) -> bool:
    """Return whether the name of a policy is that of an image."""
    return policy.partition(":")[0] in RUNTIMES


def pinned_image(policy: str) -> str:
    """Return a policy with the id of its image, ``docker:sha256:ID``, which stays when the tag moves.

    Raises:
        SourceNotFound: The runtime is not installed or does not run, or there is no such image.
        BadParameter: No image is named.
    """
    runtime, _, image = policy.partition(":")
    if not image or image.startswith("-"):
        raise BadParameter(f"{policy}: expected {runtime}:IMAGE, such as {runtime}:my_planner:1.0")
    try:
        done = subprocess.run(  # noqa: S603 - the user's own runtime
            [runtime, "image", "inspect", "--format", "{{.Id}}", image], capture_output=True, text=True, check=False
        )
    except FileNotFoundError as error:
        raise SourceNotFound(f"{policy}: {runtime} is not installed") from error
    if done.returncode:
        raise SourceNotFound(f"{policy}: {_told(done.stderr)}; start {runtime}, and build or pull the image")
    return f"{runtime}:sha256:{done.stdout.strip().removeprefix('sha256:')}"


class Container:
    """A container that runs from its first use until ``close``, and again when it has ended.

    Args:
        policy: ``docker:IMAGE`` or ``podman:IMAGE``.
    """

    def __init__(self, policy: str) -> None:
        self._policy, self._name = policy, f"scenarionet-{uuid.uuid4().hex[:12]}"
        self._runtime, _, self._image = policy.partition(":")
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __str__(self) -> str:
        """Return the policy, for errors."""
        return self._policy

    def socket(self) -> str:
        """Return the path of the socket of the container, which runs then.

        Raises:
            SourceError: It ended, or did not bind its socket in time.
        """
        if self._process is None or self._folder is None or self._process.poll() is not None:
            self.close()
            self._folder = tempfile.TemporaryDirectory(prefix="scenarionet-driver-")
            user = f"{os.getuid()}:{os.getgid()}"  # who may connect to the socket
            owner = ["--user", user] if self._runtime == "docker" or not os.getuid() else ["--userns", "keep-id"]
            words = [
                self._runtime, "run", "--rm", "--name", self._name, "--pull", "never", "--network", "none", *owner,
                "--volume", f"{self._folder.name}:{_FOLDER}", self._image, f"{_FOLDER}/socket",
            ]  # fmt: skip
            with Path(self._folder.name, "log").open("wb") as log:
                self._process = subprocess.Popen(  # noqa: S603 - the image that the user names
                    words, stdin=subprocess.DEVNULL, stdout=log, stderr=log
                )
        path, end = Path(self._folder.name, "socket"), time.monotonic() + START
        while not path.exists():
            status = self._process.poll()
            if status is not None or time.monotonic() > end:
                told = _told(Path(self._folder.name, "log").read_text("utf-8", "replace"))
                what = f"binds no socket within {START:g} s" if status is None else f"ended with {status}"
                self.close()
                raise SourceError(f"the container {what}: {told}")
            time.sleep(0.02)
        return str(path)

    def close(self) -> None:
        """End the container."""
        if self._process is not None and self._process.poll() is None:
            subprocess.run([self._runtime, "kill", self._name], capture_output=True, check=False)  # noqa: S603
            try:
                self._process.wait(10.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        if self._folder is not None:
            self._folder.cleanup()
        self._process = self._folder = None


def _told(text: str) -> str:
    """The last line that a runtime or a container has written."""
    return (text.strip().splitlines() or ["it says nothing"])[-1]
