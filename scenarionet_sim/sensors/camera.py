"""Cameras: colour, depth, classes, instances, normals and optical flow of what an agent sees."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import astuple, dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import Count, Natural, NonNegative, Positive, check_settings
from scenarionet_sim.cameras.channels import CHANNELS
from scenarionet_sim.cameras.cuda.availability import require_cuda
from scenarionet_sim.cameras.drawing import Optics, Rig, draw, poses_on, scaled_down
from scenarionet_sim.cameras.formats import add_pixel_noise
from scenarionet_sim.cameras.lenses import Intrinsics, lens_of, rays_of
from scenarionet_sim.cameras.weather import DAY, Weather, look_of
from scenarionet_sim.sensors.base import Sensor, require
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

if TYPE_CHECKING:
    from scenarionet_sim.cameras.cuda.frames import DeviceFrames

OWN_VIEWS = ("hidden", "outside", "inside")
DEVICES = ("cpu", "cuda")
_MEMORY = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else math.inf
"""Of this machine [bytes]."""

Made = TypeVar("Made")
"""Frames of one channel, on the processor or on a graphics card."""


@dataclass(frozen=True)
class Mount:
    """Place of a camera on its vehicle.

    Attributes:
        x, y: Forward and left of the middle of the box [m].
        z: Height above the ground [m].
        yaw: Counter-clockwise from straight ahead [rad].
        pitch: Upwards [rad].
        roll: Clockwise, as the camera sees it [rad].
    """

    x: float = 1.2
    y: float = 0.0
    z: float = 1.5
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        require(max(map(abs, astuple(self))) < 1e6, f"{self}; expected levels [m] and angles [rad] below a million")


@dataclass(frozen=True)
class Camera(Sensor):
    """A camera on the agent, by ray casting on the processor or on a graphics card.

    Observes (height, width, values per pixel), uint8 if all channels are uint8, else float32 with the channels one
    after another; :meth:`frames` returns each channel in a type of its own. Channels:

    * ``rgb``: 3 x uint8, sRGB.
    * ``depth``: float32 [m]: along the optical axis with a pinhole, along the ray with a fisheye; ``range`` where
      nothing is closer.
    * ``semantic``: uint8 codes of ``cameras.classes.SemanticClass``.
    * ``instance``: int32 row of the object in the state, -1 elsewhere.
    * ``normals``: 3 x float32 unit vectors in the scenario's frame, 0 in the sky.
    * ``flow``: 2 x float32 [pixels], columns and rows: where the point of a pixel will be ``flow_time`` later, if all
      objects and the agent keep their velocity and yaw rate.

    Objects stand on the ground, which has the heights of the map or is level.

    Attributes:
        width, height: [pixels].
        fov: Horizontal angle of view [rad], unless ``intrinsics`` are given; pixels are square.
        intrinsics: Focal levels fx, fy and principal point cx, cy [pixels].
        lens: ``pinhole`` or ``fisheye``.
        distortion: Coefficients k1, k2, p1, p2, k3 of a pinhole, or k1, k2, k3, k4 of a fisheye, as in OpenCV.
        mount: Place on the agent.
        channels: Names of the channels, in order.
        range: Farthest visible distance [m].
        weather: Light and weather; None to draw it for every scenario by ``seed``.
        has_sidewalks: Whether roads have kerbs and sidewalks.
        has_scenery: Whether there are buildings, trees and lamps off the road, drawn by ``seed``.
        are_boxes: Whether objects are their boxes instead of meshes.
        own: How the agent itself is shown: ``hidden``, ``outside`` as others see it, or ``inside`` as its driver does.
        exposure: Factor of brightness.
        vignette: Share of light lost in the corners.
        noise: Standard deviation of Gaussian noise [levels of 0 to 255].
        jitter: Standard deviation of the mount's angles [rad], drawn anew at every observation.
        supersampling: Rays per pixel and axis for ``rgb``; other channels have one ray per pixel.
        flow_time: [s].
        seed: Seed of scenery, textures and weather.
        threads: Largest number of threads of the processor; pictures do not depend on it.
        device: What draws: ``cpu``, or ``cuda`` for a graphics card of NVIDIA, which needs the extra ``cuda``.
    """

    width: Count = 640
    height: Count = 360
    fov: float = 1.2
    intrinsics: Intrinsics | None = None
    lens: str = "pinhole"
    distortion: tuple[float, ...] = ()
    mount: Mount = Mount()
    channels: tuple[str, ...] = ("rgb",)
    range: Positive = 500.0
    weather: Weather | None = DAY
    has_sidewalks: bool = True
    has_scenery: bool = True
    are_boxes: bool = False
    own: str = "hidden"
    exposure: Positive = 1.0
    vignette: float = 0.0
    noise: NonNegative = 0.0
    jitter: NonNegative = 0.0
    supersampling: int = 1
    flow_time: float = 0.1
    seed: Natural = 0
    threads: Count = 1
    device: str = "cpu"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("intrinsics", "distortion"):
            numbers = np.asarray(() if name == "intrinsics" and self.intrinsics is None else getattr(self, name))
            is_right = numbers.dtype.kind in "biuf" and numbers.ndim == 1
            require(
                is_right and bool(np.isfinite(numbers).all()),
                f"{name}={getattr(self, name)!r}; expected finite numbers",
            )
        for name in ("width", "height", "supersampling", "threads"):
            object.__setattr__(self, name, int(getattr(self, name)))  # kernels are compiled for one type
        require(max(self.width, self.height) <= 16384, "a camera has at most 16384 pixels along a side")
        require(self.own in OWN_VIEWS, f"own={self.own!r}; choose from {', '.join(OWN_VIEWS)}")
        require(0 < self.fov < np.pi, f"a camera's fov is above 0 and below pi [rad], found fov={self.fov}")
        require(self.lens in ("pinhole", "fisheye"), f"lens={self.lens!r}; expected 'pinhole' or 'fisheye'")
        names = self.channels if isinstance(self.channels, tuple | list) else ()
        if not names or not all(isinstance(name, str) and name in CHANNELS for name in names):
            raise BadParameter(f"channels={self.channels!r}; expected a tuple of {', '.join(CHANNELS)}")
        require(len(set(self.channels)) == len(self.channels), f"channels={self.channels!r} has one channel twice")
        if self.intrinsics is not None:
            require(len(self.intrinsics) == 4, f"intrinsics={self.intrinsics}; expected fx, fy, cx, cy")
            require(min(self.intrinsics[:2]) > 0, f"intrinsics={self.intrinsics}; focal levels must be above 0")
        most = 4 if self.lens == "fisheye" else 5
        require(len(self.distortion) <= most, f"a {self.lens} has at most {most} coefficients of distortion")
        require(1 <= self.supersampling <= 4, f"supersampling={self.supersampling}; expected 1 to 4")
        require(self.device in DEVICES, f"device={self.device!r}; choose from {', '.join(DEVICES)}")
        require(
            self._num_bytes <= _MEMORY / 2,
            f"a frame of {self.width} x {self.height} pixels takes {self._num_bytes / 1e9:.1f} GB, more than half of "
            "this machine's memory; choose fewer pixels, channels, or rays per pixel (supersampling)",
        )

    @property
    def _num_bytes(self) -> int:
        """Memory of a frame and of its rays, whose directions are stored unless they are those of a plain pinhole."""
        of_ray = 3 + (0 if self.lens == "pinhole" and not any(self.distortion) else 48)
        of_pixel = sum(
            count * np.dtype(kind).itemsize for count, kind in (CHANNELS[name][:2] for name in self.channels)
        )
        return self.width * self.height * (of_ray * self.supersampling**2 + of_pixel)

    @property
    def shape(self) -> tuple[int, ...]:
        """(height, width, values per pixel)."""
        return self.height, self.width, sum(CHANNELS[name][0] for name in self.channels)

    @property
    def is_bytes(self) -> bool:
        """Whether all channels are uint8."""
        return all(CHANNELS[name][1] is np.uint8 for name in self.channels)

    @property
    def dtype(self) -> type[np.generic]:  # type: ignore[override]  # depends on the channels
        """Type of the values."""
        return np.uint8 if self.is_bytes else np.float32

    @property
    def low(self) -> float:  # type: ignore[override]
        """Lower bound of the values."""
        return 0.0 if self.is_bytes else -np.inf

    @property
    def high(self) -> float:  # type: ignore[override]
        """Upper bound of the values."""
        return 255.0 if self.is_bytes else np.inf

    @property
    def matrix(self) -> Intrinsics:
        """Focal levels fx, fy and principal point cx, cy [pixels]."""
        if self.intrinsics is not None:
            return self.intrinsics
        half = self.fov / 2
        focal = self.width / 2 / (half if self.lens == "fisheye" else np.tan(half))
        return float(focal), float(focal), self.width / 2, self.height / 2

    @cached_property
    def _optics(self) -> dict[int, Optics]:
        """Lens and size by number of rays per pixel and axis."""
        made = {}
        for factor in {1, self.supersampling}:
            fx, fy, cx, cy = (factor * value for value in self.matrix)
            lens = lens_of(self.lens, (fx, fy, cx, cy), self.distortion)
            size = self.width * factor, self.height * factor
            rays = rays_of(tuple(lens.tolist()), *size)
            made[factor] = Optics(lens, *size, self.range, self.are_boxes, self.flow_time, rays, np.zeros(0))
        return made

    def frames(
        self,
        batch: WorldBatch,
        state: State,
        agents: Int32,
        rng: np.random.Generator | None = None,
        own: Int32 | None = None,
    ) -> dict[str, Array]:
        """Return what agents see by channel: (A, height, width) or (A, height, width, values).

        Args:
            batch: The worlds' maps, logs and paths.
            state: Current state of all objects.
            agents: (A, 2) int32 world and row of each agent.
            rng: Source of noise and jitter; unused without them.
            own: (A,) int32 rows that are shown as the own vehicle; None for those of the agents.

        Raises:
            BadParameter: These are not the parts of a simulation, or an agent is not in it.
        """
        return self._frames(batch, state, _of_simulation(batch, state, agents), rng, own)

    def _frames(
        self,
        batch: WorldBatch,
        state: State,
        agents: Int32,
        rng: np.random.Generator | None,
        own: Int32 | None = None,
    ) -> dict[str, Array]:
        if self.device == "cuda":
            return {name: seen.copy_to_host() for name, seen in self.frames_on_card(batch, state, agents, rng).items()}
        rig = self._rig(batch, state, agents, rng)
        if own is not None:
            rig.owners[:, 1] = own
        drawn = partial(draw, batch, state, rig, threads=self.threads)
        return self._finished(drawn, scaled_down, add_pixel_noise, rng)

    def frames_on_card(
        self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator | None = None
    ) -> dict[str, DeviceFrames]:
        """Return what :meth:`frames` does, in the memory of the graphics card, for ``torch.from_dlpack``.

        Raises:
            BadParameter: The camera's ``device`` is not ``cuda``, or there is no graphics card.
            MissingDependency: numba-cuda is not installed.
        """
        require(self.device == "cuda", f"device={self.device!r}; frames on a card need Camera(device='cuda')")
        require_cuda()
        from scenarionet_sim.cameras.cuda import drawing as card

        agents = _of_simulation(batch, state, agents)
        drawn = partial(card.draw, batch, state, self._rig(batch, state, agents, rng))
        return self._finished(drawn, card.scaled_down, card.add_pixel_noise, rng)

    def _rig(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator | None) -> Rig:
        """Return a camera on each agent."""
        mount, count = self.mount, len(agents)
        turns = np.empty((count, 3))
        turns[:] = mount.yaw, mount.pitch, mount.roll
        if self.jitter:
            turns += (self.jitter * (rng or np.random.default_rng()).standard_normal((3, count))).T
        poses = poses_on(batch, state, agents, (mount.x, mount.y, mount.z), turns)
        who = np.empty((count, 3), np.int32)
        who[:, :2], who[:, 2] = agents, OWN_VIEWS.index(self.own)
        names = tuple([world.scenario_id for world in batch.worlds])
        look = look_of(names, agents[:, 0], self.weather, self.seed, self.exposure, self.vignette)
        return Rig(who, poses, look, (self.has_sidewalks, self.has_scenery, self.seed))

    def _finished(
        self,
        drawn: Callable[..., dict[str, Made]],
        shrink: Callable[[Made, int], Made],
        add_noise: Callable[[Made, float, np.random.Generator], None],
        rng: np.random.Generator | None,
    ) -> dict[str, Made]:
        """Return all channels, with several rays per pixel and noise where wanted."""
        found: dict[str, Made] = {}
        if self.supersampling > 1 and "rgb" in self.channels:
            fine = drawn(optics=self._optics[self.supersampling], channels=("rgb",))["rgb"]
            found["rgb"] = shrink(fine, self.supersampling)
        if rest := tuple(name for name in self.channels if name not in found):
            found |= drawn(optics=self._optics[1], channels=rest)
        if self.noise and "rgb" in self.channels:
            add_noise(found["rgb"], self.noise, rng or np.random.default_rng())
        return {name: found[name] for name in self.channels}

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """Draw the pictures."""
        first = 0
        for name, values in self._frames(batch, state, agents, rng).items():
            count = CHANNELS[name][0]
            out[..., first : first + count] = values if count > 1 else values[..., None]
            first += count
        return out

    def split(self, observed: Array) -> dict[str, Array]:
        """Return views of the channels of observations (..., height, width, values).

        Raises:
            BadParameter: These are no observations of this camera.
        """
        found = observed.shape if isinstance(observed, np.ndarray) else observed
        is_right = isinstance(observed, np.ndarray) and observed.shape[-3:] == self.shape
        require(is_right, f"observed: expected an array (..., {', '.join(map(str, self.shape))}), found {found!r}")
        ends = np.cumsum([CHANNELS[name][0] for name in self.channels]).tolist()
        return {
            name: observed[..., end - CHANNELS[name][0] : end] for name, end in zip(self.channels, ends, strict=True)
        }


def _of_simulation(batch: WorldBatch, state: State, agents: Int32) -> Int32:
    """Agents as kernels take them.

    Raises:
        BadParameter: These are not the parts of a simulation, or an agent is not in it.
    """
    given: tuple[object, object] = (batch, state)
    if not (isinstance(given[0], WorldBatch) and isinstance(given[1], State)):
        found = ", ".join(type(each).__name__ for each in given)
        raise BadParameter(f"expected (simulation.batch, simulation.state, agents), found ({found}, ...)")
    who = np.asarray(agents)
    is_pair = who.dtype.kind in "iu" and who.ndim == 2 and who.shape[1] == 2
    if not is_pair or not ((who >= 0) & (who < state.present.shape)).all():
        num_worlds, num_objects = state.present.shape
        raise BadParameter(
            f"agents={agents!r}; expected world and row of each, such as simulation.agents, shape (A, 2), below "
            f"{num_worlds} and {num_objects}"
        )
    return who.astype(np.int32, copy=False)
