"""Generated scenes with conflicts, in which measures of criticality are compared with their authors' code."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.converters.pg import Procedural
from scenarionet_data.criticality.encounters import conflict_area, distances
from scenarionet_data.criticality.scene import Meeting, SurroundingTraffic, rates
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.scenario.description import ScenarioDescription, Tracks
from scenarionet_data.scenario.vocabulary import ObjectType

SEEDS = (1, 3, 5, 6, 7, 9, 10, 11, 13, 18, 20, 21, 23, 24, 29, 31, 32, 33, 34, 35, 36, 38, 2, 4)
_HURRY = (1.4, 2.2, 1.0)
_STEPS, _OTHERS, _EVERY = 160, 3, 11


@dataclass(frozen=True)
class Compared:
    """A scene, and what is compared of it.

    Attributes:
        scenario: The scenario; its ego is another vehicle, because CommonRoad has no ego among the obstacles.
        scene: The object whose criticality is compared.
        others: Rows of the others.
    """

    scenario: ScenarioDescription
    scene: Meeting
    others: list[int]

    def steps(self, other: int) -> list[int]:
        """The steps at which both are compared."""
        return np.flatnonzero(self.scene.is_met[other])[::_EVERY].tolist()


def scenes(seeds: Sequence[int] = SEEDS) -> Iterator[Compared]:
    """Generate scenes; in two of three the ego drives faster than it should, and into others."""
    converter = Procedural()
    shard = next(iter(converter.shards("0:40", "train", converter.release, converter.Options())))
    for seed in seeds:
        factor = _HURRY[SEEDS.index(seed) % len(_HURRY)]
        yield from meetings(_begun(_hurried(converter.scenario(shard, seed), factor)))


def recorded(lake: Lake) -> Iterator[Compared]:
    """The beginnings of recordings at the step of CommonRoad-CriMe, of vehicles of one size, as files have it."""
    for scenario in ScenarioLoader(lake, lake.select("num_map_features > 0")):
        if abs(scenario.dt - 0.1) < 1e-3:
            for each in meetings(_forward(_begun(scenario)), others=1):
                length = each.scene.traffic.length[[each.scene.row, *each.others]]
                if (np.nanmax(length, axis=1) - np.nanmin(length, axis=1)).max() < 1e-3:
                    yield each


def meetings(scenario: ScenarioDescription, others: int = _OTHERS) -> Iterator[Compared]:
    """The ego among the vehicles that come nearest to it; nothing where it meets fewer than two."""
    tracks, ego = scenario.tracks, scenario.ego_index
    scene = Meeting(_as_written(SurroundingTraffic.of(scenario)), ego)
    last = tracks.valid.shape[1] - 1 - tracks.valid[:, ::-1].argmax(axis=1)
    whole = tracks.valid.sum(axis=1) == last + 1 - tracks.valid.argmax(axis=1)
    moved = np.abs(tracks.velocity).max(axis=(1, 2)) > 0.1
    is_met = scene.is_met.any(axis=1) & (np.arange(len(moved)) != ego)
    nearest = np.flatnonzero(whole & moved & is_met & (tracks.object_type == ObjectType.VEHICLE))
    nearest = nearest[np.argsort(np.nanmin(distances(scene)[nearest], axis=1), kind="stable")]
    if len(nearest) >= 2 and whole[ego] and scene.path is not None:
        scenario = replace(scenario, ego_id=str(tracks.ids[nearest[-1]]))
        yield Compared(scenario, scene, nearest[:-1][:others].tolist())


def _as_written(traffic: SurroundingTraffic) -> SurroundingTraffic:
    """Round states to the digits that CommonRoad files have."""
    speed, heading = traffic.speed.round(5), traffic.heading.round(6)
    accel = rates(speed, traffic.seconds)
    return replace(
        traffic, x=traffic.x.round(5), y=traffic.y.round(5), heading=heading, speed=speed,
        vx=speed * np.cos(heading), vy=speed * np.sin(heading), accel=accel, jerk=rates(accel, traffic.seconds),
        length=traffic.length.round(4), width=traffic.width.round(4),
    )  # fmt: skip


def _begun(scenario: ScenarioDescription) -> ScenarioDescription:
    """Return the beginning of a scenario."""
    tracks = replace(
        scenario.tracks,
        **{name: getattr(scenario.tracks, name)[:, :_STEPS]
           for name in ("position", "heading", "velocity", "size", "valid", "is_interpolated")},
    )  # fmt: skip
    lights = replace(scenario.lights, state=scenario.lights.state[:, :_STEPS])
    return replace(scenario, tracks=tracks, lights=lights, timestamps=scenario.timestamps[:_STEPS])


def _forward(scenario: ScenarioDescription) -> ScenarioDescription:
    """Return a scenario without speeds to the side, which are no part of the measures.

    CommonRoad-CriMe takes them for speeds along y of the map.
    """
    tracks = scenario.tracks
    way = np.stack([np.cos(tracks.heading), np.sin(tracks.heading)], axis=-1)
    velocity = (tracks.velocity * way).sum(axis=-1, keepdims=True) * way
    return replace(scenario, tracks=replace(tracks, velocity=velocity.astype(np.float32)))


def _hurried(scenario: ScenarioDescription, factor: float) -> ScenarioDescription:
    """Return a scenario whose ego drives its way faster, and that ends when its way does."""
    tracks, row = scenario.tracks, scenario.ego_index
    count = int(tracks.valid[row].argmin() or tracks.valid.shape[1])
    steps = np.arange(int((count - 1) / factor) + 1)
    at = steps * factor
    position, heading, velocity = tracks.position.copy(), tracks.heading.copy(), tracks.velocity.copy()
    valid = tracks.valid.copy()
    for values, scale in ((position, 1.0), (velocity, factor)):
        for axis in range(values.shape[2]):
            values[row, steps, axis] = scale * np.interp(at, np.arange(count), values[row, :count, axis].copy())
    unwrapped = np.unwrap(tracks.heading[row, :count].astype(np.float64))
    heading[row, steps] = (np.interp(at, np.arange(count), unwrapped) + np.pi) % (2 * np.pi) - np.pi
    speed = np.hypot(velocity[row, ..., 0], velocity[row, ..., 1])
    velocity[row] = speed[:, None] * np.stack([np.cos(heading[row]), np.sin(heading[row])], axis=-1)
    for values in (position, heading, velocity, valid):
        values[row, len(steps) :] = 0
    return replace(scenario, tracks=replace(tracks, position=position, heading=heading, velocity=velocity, valid=valid))


def _start(tracks: Tracks, row: int) -> list[float]:
    first = int(tracks.valid[row].argmax())
    return [first, *tracks.position[row, first, :2].tolist()]


def write(folder: Path, compared: list[Compared], speeds: list[list[float]]) -> None:
    """Write scenes for ``tests/interop/crime_answers.py``."""
    listed = []
    for each in compared:
        tracks, scene = each.scenario.tracks, each.scene
        stem = each.scenario.id.replace("/", "_")
        files = writer_for("commonroad").write(each.scenario, stem, Losses())
        (folder / f"{stem}.xml").write_bytes(files[f"{stem}.xml"])
        areas = {str(tracks.ids[row]): conflict_area(scene.traffic, scene.row, row) for row in each.others}
        chain = [scene.traffic.lanes.centre(lane) for lane in scene.chain]
        listed.append(
            {
                "name": each.scenario.id,
                "file": f"{stem}.xml",
                "ego": str(tracks.ids[scene.row]),
                "chain": [[line[0].tolist(), line[-1].tolist()] for line in chain],
                "starts": {str(tracks.ids[row]): _start(tracks, row) for row in (scene.row, *each.others)},
                "steps": {str(tracks.ids[row]): each.steps(row) for row in each.others},
                "areas": {name: area.wkt for name, area in areas.items() if area is not None},
            }
        )
    (folder / "scenes.json").write_text(json.dumps({"scenes": listed, "rss": speeds}))
