"""A scenario that moves: in a notebook, or as a file's bytes."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.plots.drawing import Drawing
from scenarionet_data.plots.moment import Moment
from scenarionet_data.plots.scene import Scene
from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True)
class Animation:
    """A video that notebooks play in place.

    Attributes:
        content: The file's bytes.
        kind: ``mp4`` or ``gif``.
        words: What is seen.
    """

    content: bytes = field(repr=False)
    kind: str
    words: str

    def save(self, path: Path | str) -> None:
        """Write the video.

        Raises:
            BadParameter: The name ends in another kind.
        """
        if Path(path).suffix != f".{self.kind}":
            raise BadParameter(f"{path}: this animation is a {self.kind}; give a name that ends in .{self.kind}")
        Path(path).write_bytes(self.content)

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
    """A scenario as a video.

    Args:
        scenario: What is drawn.
        moments: What happened, in order, if not what was recorded.
        drawing: View, size and speed; 400 pixels with the ego in the middle unless given.
        kind: ``mp4`` (needs PyAV, extra ``video``) or ``gif``; the first that can be made unless given.

    Raises:
        BadParameter: There is no such kind.
        MissingDependency: An mp4 is wanted without PyAV.
    """
    if kind not in (None, "mp4", "gif"):
        raise BadParameter(f"no kind of video {kind!r}; there are mp4 and gif")
    scene, drawing = Scene.of(scenario), drawing or Drawing(size=400, width=80.0)
    words = f"{scene.scenario_id}, {scene.num_steps * scene.dt:.1f} s"
    if kind is None:
        try:
            return Animation(_content(drawing, scene, moments, "mp4"), "mp4", words)
        except MissingDependency:  # what everybody has is as good here
            kind = "gif"
    return Animation(_content(drawing, scene, moments, kind), kind, words)


def _content(drawing: Drawing, scene: Scene, moments: Sequence[Moment] | None, kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"scenario.{kind}"
        drawing.save(path, scene, moments)
        return path.read_bytes()
