"""What the cameras of the simulator see from any object, in the recording or in a run: one picture per request."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

from scenarionet_data import Lake, resample
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Moment, Scene
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_pipelines.messages import shorten

if TYPE_CHECKING:
    from scenarionet_sim import World

VIEWS = ("chase", "camera")
"""From behind and above the object, and from its own camera."""

SIZES = ((480, 270), (960, 540))
"""Width and height of pictures [pixel]."""


@dataclass(frozen=True)
class CameraView:
    """A camera and a moment.

    Attributes:
        object_id: Track that carries the camera.
        view: One of VIEWS.
        step: Timestep of the simulation.
        width: One of the widths of SIZES [pixel].
    """

    object_id: str
    view: str
    step: int
    width: int

    def __post_init__(self) -> None:
        if self.view not in VIEWS:
            raise BadParameter(f"no view {shorten(self.view, 40)!r} here; there are {', '.join(VIEWS)}")
        if self.width not in dict(SIZES):
            raise BadParameter(f"pictures are {' or '.join(str(width) for width in dict(SIZES))} pixels wide")


@dataclass(frozen=True)
class Footage:
    """A scenario with the motion of its recording or of a run.

    Attributes:
        world: The scenario.
        moments: Moments one timestep of the simulation apart.
    """

    world: World
    moments: Sequence[Moment]

    @classmethod
    def read(cls, lake: Lake, scenario: ScenarioDescription, run: str = "", rollout: int = 0) -> Footage:
        """Read the recording, or a run if one is named.

        Raises:
            BadParameter: The run has no such rollout of this scenario.
        """
        from scenarionet_sim import World, rollout_moments  # importing the simulator takes a second
        from scenarionet_sim.worlds.world import STEP

        scene = Scene.of(resample(scenario, STEP))
        moments = rollout_moments(lake, run, scene, rollout) if run else scene.moments()
        return cls(World.from_scenario(scenario), moments)

    def picture(self, wanted: CameraView) -> bytes:
        """Draw a picture; return it as a WebP file.

        Raises:
            BadParameter: The object does not exist, or not at that time.
        """
        from PIL import Image

        from scenarionet_sim.render.space import Film

        step = wanted.step - self.moments[0].timestep
        (rows,) = (self.world.track_ids == wanted.object_id).nonzero()
        if not len(rows) or step not in range(len(self.moments)) or not self.moments[step].present[rows[0]]:
            raise BadParameter(f"{shorten(wanted.object_id, 40)!r} is not there at timestep {wanted.step}")
        film = Film(wanted.view, wanted.width, dict(SIZES)[wanted.width])
        picture = next(film.frames(self.world, self.moments[step : step + 2], int(rows[0])))  # the second gives speeds
        content = BytesIO()
        Image.fromarray(picture).save(content, "webp", quality=82, method=0)
        return content.getvalue()
