"""Run CommonRoad-CriMe 0.4.5 and ad-rss 5.0.0 on exported scenes: values of their measures, and their time.

``python tests/interop/crime_answers.py FOLDER ANSWERS.json [MEASURE]...`` reads ``scenes.json`` and the CommonRoad
files beside it, in an environment with commonroad-crime and ad-rss, and without anything of this project. Errors of its
code that decide an answer are corrected first, in a copy, one entry of CORRECTIONS each; values are not rounded.
"""

from __future__ import annotations

import copy
import importlib
import importlib.util
import json
import logging
import shutil
import sys
import tempfile
import time
import warnings
from pathlib import Path

from crime_corrections import ADDED, CORRECTIONS, NOT_A_LANE

MEASURES = {
    "hw": "distance.hw.HW", "thw": "time.thw.THW", "ttc": "time.ttc.TTC", "dst": "acceleration.dst.DST",
    "a_long_req": "acceleration.a_long_req.ALongReq", "a_lat_req": "acceleration.a_lat_req.ALatReq",
    "a_req": "acceleration.a_req.AReq", "btn": "index.btn.BTN", "stn": "index.stn.STN", "cpi": "index.cpi.CPI",
    "tet": "time.tet.TET", "tit": "time.tit.TIT", "msd": "distance.msd.MSD", "long_jerk": "jerk.long_j.LongJ",
    "lat_jerk": "jerk.lat_j.LatJ", "dce": "distance.dce.DCE", "ttce": "time.ttce.TTCE", "wttc": "time.wttc.WTTC",
    "delta_v": "velocity.delta_v.DeltaV", "et": "time.et.ET", "pet": "time.pet.PET", "psd": "distance.psd.PSD",
    "ci": "index.ci.CI", "ttc_star": "time.ttc_star.TTCStar", "ttb": "time.ttb.TTB", "ttk": "time.ttk.TTK",
    "tts": "time.tts.TTS", "ttr": "time.ttr.TTR", "ttz": "time.ttz.TTZ", "soi": "index.soi.SOI",
}  # fmt: skip
_OF_PAIR = ("ttc_star", "ttb", "ttk", "tts", "ttr", "ttz", "soi")  # here with one obstacle: they meet all at once
_SLOW = ("cpi", "tet", "tit", "soi")  # they sum over all later steps


def correct(folder: Path) -> None:
    """Copy the package into a folder, corrected."""
    source = Path(importlib.util.find_spec("commonroad_crime").origin).parent
    shutil.copytree(source, folder / "commonroad_crime", ignore=shutil.ignore_patterns("__pycache__"))
    for name, changes in CORRECTIONS.items():
        path = folder / "commonroad_crime" / name
        text = path.read_text()
        for old, new in changes:
            if old not in text:
                raise SystemExit(
                    f"{name}: expected {old!r}, which is corrected, found none; wanted commonroad-crime 0.4.5"
                )
            text = text.replace(old, new)
        text = text.replace(NOT_A_LANE, "None")
        path.write_text(text + ADDED.get(name, ""))
    for path in folder.rglob(
        "*.py"
    ):  # errors of the frame are no ValueErrors any more since it is a package of its own
        path.write_text(path.read_text().replace("except ValueError", "except Exception"))


def answers(folder: Path, scene: dict) -> dict:
    """Return values and seconds by measure of one scene."""
    import commonroad_crime.measure.time.et as et_module
    import commonroad_crime.utility.general as general
    import commonroad_crime.utility.solver as solver
    import numpy as np
    import shapely
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.scenario.lanelet import LaneletType
    from commonroad_clcs.pycrccosy import CurvilinearCoordinateSystem
    from commonroad_crime.data_structure.configuration import CriMeConfiguration

    scenario, _ = CommonRoadFileReader(str(folder / scene["file"])).open(lanelet_assignment=False)
    network = scenario.lanelet_network
    with_crosswalks = copy.deepcopy(scenario)
    for lanelet in list(network.lanelets):  # a crosswalk is no lane
        if LaneletType.CROSSWALK in lanelet.lanelet_type:
            scenario.remove_lanelet(lanelet)
    network = scenario.lanelet_network
    general.CHAIN = [
        next(
            lanelet.lanelet_id
            for lanelet in network.lanelets
            if all(np.abs(lanelet.center_vertices[end] - wanted[end]).max() < 1e-3 for end in (0, -1))
        )
        for wanted in scene["chain"]
    ]
    number = {}
    for obstacle in scenario.obstacles:
        for track, (first, *place) in scene["starts"].items():
            state = obstacle.state_at_time(first)
            if state is not None and np.abs(state.position - place).max() < 1e-3:
                number[track] = obstacle.obstacle_id
                begin_at(obstacle, first)
        if obstacle.obstacle_id not in number.values():
            scenario.remove_obstacle(obstacle)
    ego, others = number[scene["ego"]], list(scene["steps"])
    et_module.AREAS = {number[track]: shapely.from_wkt(area) for track, area in scene["areas"].items()}
    config = CriMeConfiguration()  # it reads its parameters anew each time
    found, seconds = {}, {}
    for name in scene.get("measures") or MEASURES:
        place = MEASURES[name]
        module, _, kind = place.rpartition(".")
        kind = getattr(importlib.import_module(f"commonroad_crime.measure.{module}"), kind)
        found[name], seconds[name] = {}, []
        for other in others:
            shown = with_crosswalks if name == "ttz" else scenario
            config.update(ego_id=ego, sce=shown if name not in _OF_PAIR else only(shown, (ego, number[other])))
            path = general.generate_reference_path(None, network)
            solver.CLCS = CurvilinearCoordinateSystem(path)
            started = time.process_time()
            evaluator = kind(config)
            values = []
            steps = scene["steps"][other]
            for step in steps[:: 4 if name in _SLOW else 1]:
                try:
                    value = evaluator.compute(
                        time_step=step, verbose=False, vehicle_id=None if name == "ttz" else number[other]
                    )
                except (ZeroDivisionError, TypeError):  # no distance, or no lane
                    value = None
                values.append([step, None if value is None else repr(round(float(value), 6))])
            seconds[name].append((time.process_time() - started) / max(len(values), 1))
            found[name][other] = values
    return {"values": found, "seconds": {name: sum(each) / max(len(each), 1) for name, each in seconds.items()}}


def begin_at(obstacle: object, first: int) -> None:
    """Take away the states in which an obstacle waits far away, before it is seen."""
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.state import InitialState
    from commonroad.scenario.trajectory import Trajectory

    if first:
        state, last = obstacle.state_at_time(first), obstacle.prediction.final_time_step
        later = [obstacle.state_at_time(step) for step in range(first + 1, last + 1)]
        obstacle.initial_state = InitialState(
            time_step=first, position=state.position, orientation=state.orientation, velocity=state.velocity
        )
        obstacle.prediction = TrajectoryPrediction(Trajectory(first + 1, later), obstacle.obstacle_shape)


def only(scenario: object, numbers: tuple[int, ...]) -> object:
    """Return a copy of a scenario without other obstacles."""
    kept = copy.deepcopy(scenario)
    for obstacle in kept.obstacles:
        if obstacle.obstacle_id not in numbers:
            kept.remove_obstacle(obstacle)
    return kept


def safe_distances(cases: list[list[float]]) -> list[list[float]]:
    """Return the longitudinal and lateral safe distances of ad-rss for speeds (behind, ahead, left, right)."""
    import ad_rss

    physics, core, structured = ad_rss.physics, ad_rss.rss.core, ad_rss.rss.structured
    found = []
    for behind, ahead, left, right in cases:
        states = []
        for along, across in ((behind, left), (ahead, right)):
            state = core.RelativeObjectState()
            fill(state)
            state.object_type = ad_rss.rss.world.ObjectType.OtherVehicle
            velocity, dynamics = state.structured_object_state.velocity, state.dynamics
            velocity.speed_lon_min = velocity.speed_lon_max = physics.Speed(along)
            velocity.speed_lat_min = velocity.speed_lat_max = physics.Speed(-across)  # to the right
            dynamics.response_time = physics.Duration(1.0)
            dynamics.lateral_fluctuation_margin = dynamics.min_longitudinal_safety_distance = physics.Distance(0.0)
            dynamics.max_speed_on_acceleration = physics.Speed(100.0)
            lon, lat = dynamics.alpha_lon, dynamics.alpha_lat
            lon.accel_max, lon.brake_min, lon.brake_max = (physics.Acceleration(each) for each in (3.5, -4.0, -8.0))
            lon.brake_min_correct = physics.Acceleration(-3.0)
            lat.accel_max, lat.brake_min = physics.Acceleration(0.2), physics.Acceleration(-0.8)
            states.append(state)
        distances = []
        for function, first, second in (
            (structured.calculateSafeLongitudinalDistanceSameDirection, states[1], states[0]),
            (structured.calculateSafeLateralDistance, states[0], states[1]),
        ):
            distance = physics.Distance(0.0)
            if not function(first, second, distance):
                raise SystemExit(f"ad-rss does not answer {function.__name__}")
            distances.append(distance.mDistance)
        found.append(distances)
    return found


def fill(part: object) -> None:
    """Set all numbers of a part of ad-rss to 1, of which it accepts none that is not given."""
    for name in dir(part):
        inner = getattr(part, name)
        if name.startswith("_") or (callable(inner) and not hasattr(inner, "assign")):
            continue
        if type(inner) is int:
            setattr(part, name, 1)
        elif type(inner).__module__ == "physics" and not any(
            hasattr(inner, each) for each in ("x", "length", "minimum")
        ):
            setattr(part, name, type(inner)(1.0))
        elif type(inner).__module__ in ("physics", "world", "core") and not isinstance(inner, int):
            fill(inner)


def main(folder: Path, answer: Path, *measures: str) -> None:
    """Answer all scenes of a folder."""
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    wanted = json.loads((folder / "scenes.json").read_text())
    with tempfile.TemporaryDirectory() as corrected:
        correct(Path(corrected))
        sys.path.insert(0, corrected)
        result = {
            "scenes": {scene["name"]: answers(folder, scene | {"measures": measures}) for scene in wanted["scenes"]}
        }
    result["rss"] = [[*case, *found] for case, found in zip(wanted["rss"], safe_distances(wanted["rss"]), strict=True)]
    answer.write_text(json.dumps(result))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
