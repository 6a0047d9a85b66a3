"""Exports with pictures: what a camera on the ego sees, in the files of formats that hold pictures."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from scenarionet_data import ScenarioDescription
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import CameraFiles, FormatWriter, Losses
from scenarionet_sim.render.space import Film, recorded_moments
from scenarionet_sim.worlds.world import World

_QUALITY = 85  # of JPEG


class PictureWriter(FormatWriter, Protocol):
    """A writer of a format that holds pictures."""

    def write(
        self, scenario: ScenarioDescription, stem: str, losses: Losses, pictures: CameraFiles | None = None
    ) -> Mapping[str, bytes]:
        """As in ``FormatWriter``, with JPEG files by name of the camera, one for each timestep."""
        ...


@dataclass(frozen=True)
class WithPictures:
    """A writer that adds the pictures of films.

    Attributes:
        writer: The format.
        films: The views.
    """

    writer: PictureWriter
    films: tuple[Film, ...]

    @property
    def name(self) -> str:
        """Name of the format."""
        return self.writer.name

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the files of a scenario, with a picture for each of its timesteps.

        Raises:
            InvalidScenario: The ego is not seen at each timestep, or the timestep is not that of the simulator.
        """
        from PIL import Image

        world = World.from_scenario(scenario)
        moments = recorded_moments(world)
        if len(moments) != scenario.num_timesteps:
            raise InvalidScenario(
                scenario.id,
                "ego",
                f"pictures want it at each of {scenario.num_timesteps} timesteps of {world.dt} s, found {len(moments)}",
            )
        pictures: dict[str, list[bytes]] = {}
        for film in self.films:
            pictures[film.view] = []
            for frame in film.frames(world, moments):
                file = io.BytesIO()
                Image.fromarray(frame).save(file, "JPEG", quality=_QUALITY)
                pictures[film.view].append(file.getvalue())
        return self.writer.write(scenario, stem, losses, pictures)
