"""A world's moments to a file: what is seen, how large, how fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.errors import BadParameter
from scenarionet_sim.render.files import PICTURES, VIDEOS, write_picture, write_video
from scenarionet_sim.render.moment import Moment
from scenarionet_sim.render.topdown import TRAIL, TopDown
from scenarionet_sim.render.window import Window
from scenarionet_sim.worlds.world import World

VIEWS = ("route", "ego", "all")


@dataclass(frozen=True)
class Drawing:
    """How a scenario is drawn.

    Attributes:
        view: ``route`` shows all of the ego's route, ``ego`` keeps the ego in the middle, ``all`` shows everything
            recorded; None: the route in a picture, the ego in a video.
        width: What the view ``ego`` sees across [m].
        size: Longer side [pixel].
        speed: Of a video; 2 is twice as fast as it was.
    """

    view: str | None = None
    width: float = 100.0
    size: int = 1000
    speed: float = 1.0

    def save(
        self,
        path: Path | str,
        world: World,
        moments: Sequence[Moment],
        now: int = -1,
        on_frame: Callable[[int], None] | None = None,
    ) -> int:
        """Write a picture of one moment, or a video of all.

        Args:
            path: Its ending says what is written: .png, .pdf, .svg, .gif or .mp4.
            world: The world.
            moments: Its moments, in order.
            now: The moment of a picture.
            on_frame: Told how many frames of a video are done.

        Returns:
            Number of frames.

        Raises:
            BadParameter: The name ends otherwise.
            MissingDependency: An mp4, without PyAV.
        """
        kind = Path(path).suffix
        if kind not in (*PICTURES, *VIDEOS):
            raise BadParameter(f"{path}: give a name that ends with one of {', '.join((*PICTURES, *VIDEOS))}")
        if kind in PICTURES:
            last = range(len(moments))[now]
            view = self.view or "route"
            write_picture(path, world, _until(moments, last), self.window(view, world, moments[last]), self.size)
            return 1
        view = self.view or "ego"
        camera = TopDown(world, self.window(view, world, moments[0]), self.size, follows=view == "ego")
        frames = (camera.frame(_until(moments, last)) for last in range(len(moments)))
        write_video(path, frames, self.speed / world.dt, on_frame)
        return len(moments)

    def window(self, view: str, world: World, moment: Moment) -> Window:
        """What is seen.

        Raises:
            BadParameter: There is no such view.
        """
        if view == "route":
            return Window.on_route(world)
        if view == "all":
            return Window.on_everything(world)
        if view == "ego":
            x, y = moment.position[world.ego].tolist()
            return Window(x, y, self.width, self.width)
        raise BadParameter(f"no view {view!r}; there are {', '.join(VIEWS)}")


def _until(moments: Sequence[Moment], last: int) -> Sequence[Moment]:
    return moments[max(last - TRAIL, 0) : last + 1]
