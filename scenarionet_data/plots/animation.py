"""Videos of scenarios for notebooks."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.plots.drawing import Drawing
from scenarionet_data.plots.scene import Moment, Scene
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage.files.places import local_path


@dataclass(frozen=True)
class Animation:
    """A video that notebooks display.

    Attributes:
        content: Content of the video file.
        kind: ``mp4`` or ``gif``.
        words: Alternative text.
    """

    content: bytes = field(repr=False)
    kind: str
    words: str

    def save(self, path: Path | str) -> None:
        """Write the video to a file.

        Raises:
            BadParameter: The suffix does not match the kind of the video.
        """
        if Path(path).suffix != f".{self.kind}":
            raise BadParameter(f"{path}: this animation is a {self.kind}; give a name that ends in .{self.kind}")
        local_path(path, "a video").write_bytes(self.content)

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.content).decode("ascii")
        words = escape(self.words, quote=True)
        if self.kind == "gif":
            return f'<img src="data:image/gif;base64,{data}" alt="{words}" title="{words}">'
        return (
            f'<video controls loop muted playsinline title="{words}" src="data:video/mp4;base64,{data}">'
            f"{words}: this browser plays no video</video>"
        )


def animate(
    scenario: ScenarioDescription | Scene,
    moments: Sequence[Moment] | None = None,
    *,
    drawing: Drawing | None = None,
    kind: str | None = None,
) -> Animation:
    """Render a scenario as a video.

    Args:
        scenario: The scenario.
        moments: Object states in order, for example of a simulation; the recording by default.
        drawing: View, size and speed; by default 400 pixels, following the ego.
        kind: ``mp4`` (requires PyAV, extra ``video``) or ``gif``; by default mp4 if PyAV is installed.

    Raises:
        BadParameter: The kind is unknown.
        MissingDependency: ``kind`` is mp4 and PyAV is not installed.
    """
    if kind not in (None, "mp4", "gif"):
        raise BadParameter(f"no kind of video {kind!r}; there are mp4 and gif")
    scene, drawing = Scene.of(scenario), drawing or Drawing(size=400, width=80.0)
    words = f"{scene.scenario_id}, {scene.num_steps * scene.dt:.1f} s"
    if kind is None:
        try:
            return Animation(_content(drawing, scene, moments, "mp4"), "mp4", words)
        except MissingDependency:  # a gif needs no extra
            kind = "gif"
    return Animation(_content(drawing, scene, moments, kind), kind, words)


def _content(drawing: Drawing, scene: Scene, moments: Sequence[Moment] | None, kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"scenario.{kind}"
        drawing.save(path, scene, moments)
        return path.read_bytes()
