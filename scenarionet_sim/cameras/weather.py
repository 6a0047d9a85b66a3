"""Light and weather: specifications, presets, and the arrays that kernels take."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import check_settings
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.shading import OCTAVES
from scenarionet_sim.cameras.draw.sky import GRAIN_SIZE
from scenarionet_sim.cameras.draw.structures import Look


@dataclass(frozen=True)
class Weather:
    """Light and weather of a scene.

    Attributes:
        sun_elevation: Of the sun over the horizon [rad]; up to 0 it is night, lit by headlights and street lamps.
        sun_azimuth: Direction to the sun [rad], counter-clockwise from +x of the scenario.
        clouds: Share of the sky that is cloudy, in [0, 1]; from 0.8 on the sun casts no shadows.
        haze: Inverse of the distance at which half of the light is haze [1/m].
        wetness: Of the road, in [0, 1].
    """

    sun_elevation: float = 0.85
    sun_azimuth: float = 0.9
    clouds: float = 0.35
    haze: float = 1 / 1200
    wetness: float = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        if not abs(self.sun_elevation) <= np.pi / 2:
            raise BadParameter(f"sun_elevation={self.sun_elevation}; expected an angle in [-pi/2, pi/2] [rad]")
        if not (0 <= self.clouds <= 1 and 0 <= self.wetness <= 1 and self.haze >= 0):
            raise BadParameter(f"{self}; expected clouds and wetness in [0, 1], and haze of at least 0 per metre")


DAY = Weather()
DUSK = Weather(sun_elevation=0.10, sun_azimuth=0.4, clouds=0.45, haze=1 / 500)
OVERCAST = Weather(sun_elevation=0.7, clouds=0.9, haze=1 / 700)
RAIN = Weather(sun_elevation=0.6, clouds=1.0, haze=1 / 160, wetness=1.0)
NIGHT = Weather(sun_elevation=-0.3, clouds=0.2, haze=1 / 900)

WEATHERS = {"day": DAY, "dusk": DUSK, "night": NIGHT, "overcast": OVERCAST, "rain": RAIN}
"""Presets by name."""


def random_weather(seed: int, name: str) -> Weather:
    """Return the weather of a scenario, drawn by seed and id."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    is_wet = rng.random() < 0.2
    clouds = float(rng.uniform(0.85, 1.0) if is_wet else rng.uniform(0.0, 0.9))
    return Weather(
        sun_elevation=float(rng.uniform(0.08, 1.2)),
        sun_azimuth=float(rng.uniform(0.0, 2.0 * np.pi)),
        clouds=clouds,
        haze=float(1.0 / rng.uniform(120.0 if is_wet else 300.0, 1500.0)),
        wetness=float(rng.uniform(0.5, 1.0)) if is_wet else 0.0,
    )


_HIGH_SUN, _LOW_SUN = np.array([2.55, 2.40, 2.15]), np.array([1.9, 0.85, 0.30])
_HIGH_SKY, _LOW_SKY = np.array([0.42, 0.55, 0.78]), np.array([0.20, 0.22, 0.33])
_ZENITH, _LOW_ZENITH = np.array([0.10, 0.26, 0.68]), np.array([0.07, 0.12, 0.28])
_HORIZON, _LOW_HORIZON = np.array([0.62, 0.76, 0.94]), np.array([0.78, 0.44, 0.24])
_NIGHT = np.array([
    (0.0, 0.0, 1.0), (2.3, 1.9, 1.3), (0.040, 0.050, 0.080), (0.006, 0.007, 0.010), (0.008, 0.013, 0.030),
    (0.030, 0.031, 0.042),
])  # fmt: skip
_GREY = np.array([0.60, 0.63, 0.67])


def look_of(
    names: tuple[str, ...], slots: Int32, weather: Weather | None, seed: int, exposure: float, vignette: float
) -> Look:
    """Return the light of frames as kernels take it.

    Args:
        names: Ids of the scenarios in all slots.
        slots: (B,) slots of the frames.
        weather: Of all frames; None to draw it for every scenario by ``seed``.
        seed: Seed of weather and textures.
        exposure: Factor of brightness.
        vignette: Share of light lost in the corners.
    """
    return Look(_lights(names, weather, seed, exposure, vignette)[slots], _grain(), _tone())


@lru_cache(maxsize=64)
def _lights(names: tuple[str, ...], weather: Weather | None, seed: int, exposure: float, vignette: float) -> Float64:
    """Return the light (W, NUM_LIGHT) of slots."""
    lights = np.array([_light(weather or random_weather(seed, name)) for name in names]).reshape(-1, at.NUM_LIGHT)
    lights[:, at.EXPOSURE], lights[:, at.VIGNETTE] = exposure, vignette
    lights[:, at.SHIFT] = [zlib.crc32(name.encode(), seed) % 512 for name in names]
    return lights


@lru_cache
def _light(weather: Weather) -> Float64:
    """Return the light (NUM_LIGHT,) of a weather."""
    rise, turn = weather.sun_elevation, weather.sun_azimuth
    sun = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    if weather.clouds >= 0.8:
        sun = np.array([0.0, 0.0, 1.0])  # what is left is dark under objects, not behind them
    high = min(max(rise, 0.0) / 0.6, 1.0) ** 0.7
    dull = np.clip((weather.clouds - 0.5) / 0.4, 0.0, 1.0)
    sunlight = (high * _HIGH_SUN + (1 - high) * _LOW_SUN) * (1 - 0.94 * dull)
    skylight = (high * _HIGH_SKY + (1 - high) * _LOW_SKY) * (1 - dull) + dull * (0.45 + 0.75 * high) * _GREY
    zenith = (high * _ZENITH + (1 - high) * _LOW_ZENITH) * (1 - dull) + dull * (0.35 + 0.55 * high) * _GREY
    horizon = (high * _HORIZON + (1 - high) * _LOW_HORIZON) * (1 - dull) + dull * (0.45 + 0.65 * high) * _GREY
    bounce = 0.16 * (sunlight * np.sin(rise) + skylight)
    light = np.zeros(at.NUM_LIGHT)
    light[: at.HORIZON + 3] = np.concatenate([sun, sunlight, skylight, bounce, zenith, horizon])
    light[[at.HAZE, at.CLOUD, at.WET]] = 0.73 * weather.haze, weather.clouds, weather.wetness
    light[at.LAMPS] = np.clip(1.0 - rise / 0.35, weather.wetness, 1.0)
    if rise <= 0.0:
        light[: at.HORIZON + 3], light[at.NIGHT] = _NIGHT.ravel(), 1.0
    light[at.SHADOW] = 0.55 + 0.45 * (weather.clouds < 0.8)
    return light


@lru_cache
def _grain() -> UInt8:
    """Return fine and coarse noise (2, S * S) that repeats without seams."""
    rng = np.random.default_rng(11)
    size = GRAIN_SIZE
    waves = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.fftfreq(size)[None, :])
    tables = []
    for low, high in ((0.0, 0.33), (0.0, 0.035)):
        spectrum = np.fft.fft2(rng.standard_normal((size, size)))
        spectrum *= np.exp(-((waves / high) ** 2)) * (waves > low) / np.maximum(waves, 0.006) ** 0.35
        noise = np.real(np.fft.ifft2(spectrum))
        noise = (noise - noise.mean()) / noise.std()
        tables.append(np.clip(127.5 + 50.0 * noise, 0, 255).ravel())
    grain: UInt8 = np.array(tables).astype(np.uint8)
    grain.flags.writeable = False
    return grain


@lru_cache
def _tone() -> Float32:
    """Return the tone curve, see ``Look.tone``; levels are to 0.2 those of sRGB with highlights compressed."""
    curve = np.polynomial.Chebyshev.interpolate(_level, 8, domain=OCTAVES)
    tone: Float32 = np.polynomial.chebyshev.cheb2poly(curve.coef).astype(np.float32)
    tone[0] += 0.5
    tone.flags.writeable = False
    return tone


def _level(octave: Float64) -> Float64:
    """Return the level of linear light by its binary logarithm (IEC 61966-2-1)."""
    light = np.minimum(1.25 * 2.0**octave / (2.0**octave + 0.75), 1.0)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
