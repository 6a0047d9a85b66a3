"""Run RefAV's own relations (https://github.com/CainanD/RefAV, commit 5c5be64) on one Argoverse 2 sensor log.

``python tests/interop/refav_answers.py CHECKOUT LOG ANSWERS.json`` writes the timesteps at which each relation holds,
and the processor time that it took, in an environment with av2, pathos, scipy, pandas, shapely and tqdm, and without
anything of this project. Errors of its code that decide an answer are corrected first, one entry of CORRECTIONS each.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import itertools
import json
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import MagicMock

CORRECTIONS = {
    "atomic_functions.py": [
        # The rotation of the second and later candidates is lost: the loop writes its sign into `direction`.
        ("direction = (y1-y0)/abs(y1-y0)", "way = (y1-y0)/abs(y1-y0)"),
        ("if (direction == 1 and in_direction == 'clockwise'", "if (way == 1 and in_direction == 'clockwise'"),
        (
            "or direction == -1 and in_direction == 'counterclockwise'",
            "or way == -1 and in_direction == 'counterclockwise'",
        ),
        ("direction*candidate_pos[start_index, 1]", "way*candidate_pos[start_index, 1]"),
        ("direction*candidate_vel[start_index,1]", "way*candidate_vel[start_index,1]"),
        ("direction*candidate_pos[end_index, 1]", "way*candidate_pos[end_index, 1]"),
        ("direction*candidate_vel[end_index, 1]", "way*candidate_vel[end_index, 1]"),
        # After the first step only crossings that the box overlapped one step before are looked at.
        ("ped_crossings = get_pedestrian_crossings(avm, track_poly)", "pass"),
        # The first step of a track is never part of a change.
        ("while lane_change_start > 0:", "while lane_change_start >= 0:"),
        ("start_idx = min(0, closest_waypoint_idx - 1)", "start_idx = max(0, closest_waypoint_idx - 1)"),
        # The rule for turns at the ends of a track is in the branch for right turns, where it changes nothing.
        ("            #elif (unwrap_func(near_intersection)(track_uuid, log_dir) \n", "            else:\n"),
        # The velocity across the lane is meant, the one to the north of the city is taken.
        ("and abs(velocities[i,1]) >= SIDEWAYS_VEL_THRESH", ""),
        (
            "if lane_change_cos_similarity >= COS_SIMILARITY_THRESH:",
            "if lane_change_cos_similarity >= COS_SIMILARITY_THRESH and np.linalg.norm(velocities[i,:2])"
            " * np.sqrt(max(0, 1 - lane_change_cos_similarity ** 2)) >= SIDEWAYS_VEL_THRESH:",
        ),
        # The speed of approach is in metres per timestep of 0.1 s.
        ("-track_radial_vel[i] >= minimum_speed", "-track_radial_vel[i] >= minimum_speed / 10"),
        # Outlines that are widened by moving their corners reach further than the distance at acute corners.
        (
            "pc_poly = dilate_convex_polygon(pc_poly[:,:2], distance=within_distance)",
            "pc_poly = np.array(__import__('shapely').Polygon(pc_poly[:,:2]).buffer(within_distance).exterior.coords)",
        ),
        (
            "dilated_intersections.append(dilate_convex_polygon(ls[:,:2], threshold))",
            "dilated_intersections.append(np.array(__import__('shapely').Polygon(ls[:,:2]).buffer(threshold).exterior.coords))",
        ),
    ],
    "utils.py": [
        # The third component of a rotation vector is not the heading of a box that is not level.
        (
            "city_yaws[i] = Rotation.from_matrix(self_to_city_list[i].rotation).as_rotvec()",
            "city_yaws[i, 2] = np.arctan2(self_to_city_list[i].rotation[1, 0], self_to_city_list[i].rotation[0, 0])",
        ),
        # The nearest lane is meant, the last is taken.
        ("            best_ls = ls\n", "            best_ls, best_dist = ls, dist\n"),
    ],
}
EGO = "ego"
"""Id of the recording vehicle; its box (4.877 m by 2 m, centred 1.422 m ahead of the rear axle) is added to the log."""

SINGLE = [
    *(("turning", {"direction": side}) for side in ("left", "right", None)),
    *(("changing_lanes", {"direction": side}) for side in ("left", "right", None)),
    ("at_pedestrian_crossing", {}),
    ("at_stop_sign", {}),
    *(("on_lane_type", {"lane_type": kind}) for kind in ("BUS", "VEHICLE", "BIKE")),
    ("near_intersection", {}),
    ("on_intersection", {}),
    ("in_drivable_area", {}),
    ("on_road", {}),
    ("has_velocity", {}),
    ("stationary", {}),
    ("accelerating", {}),
    ("has_lateral_acceleration", {"min_accel": 0.5}),
    ("is_category", {"category": "PEDESTRIAN"}),
]
SIDES = ("forward", "backward", "left", "right")
PAIRS = [
    ("following", {}),
    ("in_same_lane", {}),
    *(("on_relative_side_of_road", {"side": side}) for side in ("same", "opposite")),
    *(("being_crossed_by", {"direction": side}) for side in SIDES),
    *(("being_crossed_by", {"in_direction": way}) for way in ("clockwise", "counterclockwise")),
    ("near_objects", {"distance_thresh": 10}),
    ("facing_toward", {}),
    ("heading_toward", {}),
    *(("heading_in_relative_direction_to", {"direction": way}) for way in ("same", "opposite", "perpendicular")),
    *(("has_objects_in_relative_direction", {"direction": side, "lateral_thresh": 3.0}) for side in SIDES),
]


def corrected(checkout: Path, folder: Path) -> None:
    """Copy RefAV's package to a folder, with CORRECTIONS.

    Raises:
        ValueError: A text that is to be corrected is not there.
    """
    package = folder / "refAV"
    package.mkdir()
    for path in (checkout / "refAV").glob("*.py"):
        text = path.read_text("utf-8")
        for wrong, right in CORRECTIONS.get(path.name, ()):
            if wrong not in text:
                raise ValueError(f"{path}: {wrong!r} is not in it; take commit 5c5be64")
            text = text.replace(wrong, right)
        (package / path.name).write_text(text, "utf-8")


def with_ego(log: Path, folder: Path) -> Path:
    """Copy a log's poses to a folder, with its annotations and a box for the recording vehicle."""
    import pandas as pd

    copy = folder / log.name
    copy.mkdir()
    (copy / "map").symlink_to((log / "map").resolve())
    (copy / "city_SE3_egovehicle.feather").symlink_to((log / "city_SE3_egovehicle.feather").resolve())
    boxes = pd.read_feather(log / "annotations.feather")
    ego = pd.DataFrame({"timestamp_ns": sorted(boxes.timestamp_ns.unique())})
    values = {"track_uuid": EGO, "category": "REGULAR_VEHICLE", "length_m": 4.877, "width_m": 2.0, "height_m": 1.473}
    zeros = dict.fromkeys(("qx", "qy", "qz", "ty_m", "tz_m"), 0.0)
    ego = ego.assign(**values, **zeros, qw=1.0, tx_m=1.422, num_interior_pts=1)
    pd.concat([boxes, ego], ignore_index=True).to_feather(copy / "sm_annotations.feather")
    return copy


def load(folder: Path, log: Path):
    """Return RefAV's modules ``atomic_functions`` and ``utils``, in this process and reading each file once."""
    for name in ("torch", "torch.utils", "torch.utils.data", "torch.nn", "torch.nn.functional", "transformers"):
        sys.modules[name] = MagicMock()
    sys.modules["torch"].Tensor = type("Tensor", (), {})
    sys.path.insert(0, str(folder))
    import refAV.atomic_functions as relations
    import refAV.utils as helpers
    from av2.map.map_api import ArgoverseStaticMap

    helpers.read_feather = functools.cache(helpers.read_feather)
    lanes_of = functools.cache(lambda track: found_lanes(track, log))
    found_lanes, inside = helpers.get_scenario_lanes, helpers.is_point_in_polygon
    for module in (relations, helpers):  # lanes of an object are found once, among those whose bounding box it is in
        module.get_scenario_lanes = lambda track, log_dir, avm=None: lanes_of(track)
    city = ArgoverseStaticMap.from_map_dir(log / "map", build_raster=False)
    lanes = city.vector_lane_segments
    for name, other in [(lane.id, other) for lane in lanes.values() for other in lane.successors if other in lanes]:
        if name not in lanes[other].predecessors:  # the map names many successors, but few predecessors
            lanes[other].predecessors.append(name)
    outlines = [(lane, lane.polygon_boundary[:, :2]) for lane in city.get_scenario_lane_segments()]
    outlines = [(lane, points, points.min(axis=0), points.max(axis=0)) for lane, points in outlines]
    helpers.get_lane_segments = lambda _, at: [
        lane
        for lane, points, low, high in outlines
        if (at[:2] >= low).all() and (at[:2] <= high).all() and inside(at[:2], points)
    ]
    poses = helpers.read_city_SE3_ego(log)
    for module in (relations, helpers):
        module.get_map = lambda _: city
        module.get_ego_SE3 = lambda _: poses
        module.get_ego_uuid = lambda _: "no other id"  # its box is one like the others

    def in_one_process(function, tracks, *args, **kwargs):
        """Its pool of processes, as a loop."""
        function = helpers.unwrap_func(function)
        steps, related = {}, {}
        for track in tracks:
            found = function(track, *args, **kwargs)
            steps[track], related[track] = found if isinstance(found, tuple) else (found, None)
        return steps, related

    helpers.parallelize_uuids = in_one_process
    return relations, helpers


def spans(steps: list[int]) -> list[list[int]]:
    """Return sorted steps as first and last of each run."""
    runs = (list(run) for _, run in itertools.groupby(enumerate(steps), lambda item: item[1] - item[0]))
    return [[run[0][1], run[-1][1]] for run in runs]


def main() -> None:
    """Write the answers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path)
    parser.add_argument("log", type=Path)
    parser.add_argument("answers", type=Path)
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp())
    corrected(arguments.checkout, folder)
    log = with_ego(arguments.log, folder)
    relations, helpers = load(folder, log)

    boxes = helpers.read_feather(log / "sm_annotations.feather")
    timesteps = {int(stamp): step for step, stamp in enumerate(sorted(boxes.timestamp_ns.unique()))}
    tracks = {str(name): sorted(map(int, rows.timestamp_ns)) for name, rows in boxes.groupby("track_uuid", sort=False)}
    moved = {}
    for name in tracks:
        centres = helpers.get_nth_pos_deriv(name, 0, log)[0]
        moved[name] = float(abs(centres.max(axis=0) - centres.min(axis=0))[:2].sum())
    category = boxes.drop_duplicates("track_uuid").set_index("track_uuid").category
    movers = sorted(tracks, key=lambda name: -moved[name])
    chosen = [EGO, *[name for name in movers if category[name] != "PEDESTRIAN" and name != EGO][:13]]
    chosen += [name for name in movers if category[name] == "PEDESTRIAN"][:6]

    answers = []
    for name, parameters in SINGLE + PAIRS:
        function = getattr(relations, name)
        begin = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()):
            if (name, parameters) in SINGLE:
                found = function(tracks, log, **parameters)
                held = {track: {track: steps} for track, steps in found.items()}
            else:
                some = {track: tracks[track] for track in chosen}
                found = function(some, dict(some), log, **parameters)
                held = {track: others for track, others in found.items() if isinstance(others, dict)}
        seconds = time.process_time() - begin
        rows = {
            f"{track} {other}": spans(sorted({timesteps[int(stamp)] for stamp in stamps}))
            for track, others in held.items()
            for other, stamps in others.items()
        }
        answers.append({"relation": name, "parameters": parameters, "seconds": round(seconds, 3), "held": rows})
        print(f"{name} {parameters}: {len(rows)} objects or pairs, {seconds:.2f} s", flush=True)
        arguments.answers.write_text(json.dumps({"chosen": chosen, "answers": answers}))


if __name__ == "__main__":
    main()
