"""Print as JSON what av2 reads from a motion forecasting folder, from the map of a sensor log, or from a submission."""

import json
import sys
from pathlib import Path

from av2.datasets.motion_forecasting import scenario_serialization
from av2.datasets.motion_forecasting.eval.submission import ChallengeSubmission
from av2.map.map_api import ArgoverseStaticMap


def read_map(path):
    roads = ArgoverseStaticMap.from_json(path)
    lanes = {
        lane.id: {
            "left": lane.left_lane_boundary.xyz.tolist(),
            "right": lane.right_lane_boundary.xyz.tolist(),
            "predecessors": lane.predecessors,
            "successors": lane.successors,
            "is_intersection": lane.is_intersection,
            "center": roads.get_lane_segment_centerline(lane.id).tolist(),
        }
        for lane in roads.get_scenario_lane_segments()
    }
    areas = {area.id: area.xyz.tolist() for area in roads.get_scenario_vector_drivable_areas()}
    crossings = {c.id: [c.edge1.xyz.tolist(), c.edge2.xyz.tolist()] for c in roads.get_scenario_ped_crossings()}
    return {"lanes": lanes, "areas": areas, "crossings": crossings}


def read_scenario(path):
    scenario = scenario_serialization.load_argoverse_scenario_parquet(path)
    tracks = {
        track.track_id: {
            "type": track.object_type.value,
            "category": track.category.name,
            "states": [[s.timestep, *s.position, s.heading, *s.velocity] for s in track.object_states],
        }
        for track in scenario.tracks
    }
    return {"id": scenario.scenario_id, "focal": scenario.focal_track_id, "city": scenario.city_name, "tracks": tracks}


def read_submission(path):
    return {
        scenario: {
            "probabilities": probabilities.tolist(),
            "tracks": {name: trajectories.tolist() for name, trajectories in tracks.items()},
        }
        for scenario, (probabilities, tracks) in ChallengeSubmission.from_parquet(path).predictions.items()
    }


def main(folder):
    if folder.endswith(".parquet"):
        json.dump(read_submission(folder), sys.stdout)
        return
    (map_file,) = Path(folder).rglob("log_map_archive_*.json")
    scenarios = [read_scenario(path) for path in Path(folder).glob("scenario_*.parquet")]
    json.dump({"map": read_map(map_file), "scenarios": scenarios}, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
