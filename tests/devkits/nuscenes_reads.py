"""Print as JSON what nuscenes-devkit reads from a dataroot. Runs in the devkit's own environment."""

import json
import sys

from nuscenes.eval.prediction.splits import get_prediction_challenge_split
from nuscenes.map_expansion.map_api import NuScenesMap
from nuscenes.nuscenes import NuScenes

SPACING = 1.0


def read_scene(tables, scene):
    samples, token = [], scene["first_sample_token"]
    while token:
        sample = tables.get("sample", token)
        pose = tables.get("ego_pose", tables.get("sample_data", sample["data"]["LIDAR_TOP"])["ego_pose_token"])
        boxes = {}
        for name in sample["anns"]:
            box = tables.get_box(name)
            boxes[tables.get("sample_annotation", name)["instance_token"]] = {
                "center": box.center.tolist(),
                "yaw": box.orientation.yaw_pitch_roll[0],
                "wlh": box.wlh.tolist(),
                "name": box.name,
                "velocity": tables.box_velocity(name)[:2].tolist(),
            }
        time, ego = sample["timestamp"], pose["translation"]
        samples.append({"token": token, "timestamp": time, "ego": ego, "boxes": boxes})
        token = sample["next"]
    location = tables.get("log", scene["log_token"])["location"]
    return {"location": location, "samples": samples}


def read_map(dataroot, location):
    expansion = NuScenesMap(dataroot, location)
    lanes = [record["token"] for record in expansion.lane + expansion.lane_connector]
    polygons = [token for record in expansion.drivable_area for token in record["polygon_tokens"]]
    return {
        "lanes": expansion.discretize_lanes(lanes, SPACING),
        "outgoing": {token: expansion.get_outgoing_lane_ids(token) for token in lanes},
        "incoming": {token: expansion.get_incoming_lane_ids(token) for token in lanes},
        "drivable": [expansion.extract_polygon(token).area for token in polygons],
        "stop_lines": {r["token"]: r["stop_line_type"] for r in expansion.stop_line},
    }


def main(dataroot, release):
    tables = NuScenes(release, dataroot, verbose=False)
    scenes = {scene["name"]: read_scene(tables, scene) for scene in tables.scene}
    locations = sorted({scene["location"] for scene in scenes.values()})
    challenge = {split: get_prediction_challenge_split(split, dataroot) for split in ("mini_train", "mini_val")}
    maps = {location: read_map(dataroot, location) for location in locations}
    json.dump({"scenes": scenes, "maps": maps, "challenge": challenge}, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
