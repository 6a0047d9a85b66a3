"""Open CommonRoad scenarios and solutions with commonroad-io; print what it found in each as a line of JSON."""

import json
import logging
import sys
import warnings

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.solution import CommonRoadSolutionReader

logging.disable(logging.CRITICAL)
warnings.simplefilter("ignore")


def row(state):
    return [state.time_step, *map(float, state.position), float(state.orientation)]


for name in sys.argv[1:]:
    scenario, problems = CommonRoadFileReader(name).open()
    lanelets = scenario.lanelet_network.lanelets
    states = {}
    for obstacle in scenario.dynamic_obstacles:
        states[obstacle.obstacle_id] = [
            row(obstacle.initial_state),
            *map(row, obstacle.prediction.trajectory.state_list),
        ]
    for obstacle in scenario.static_obstacles:
        states[obstacle.obstacle_id] = [row(obstacle.initial_state)]
    solution = CommonRoadSolutionReader.open(name.replace(".xml", ".solution.xml")).planning_problem_solutions[0]
    found = {
        "lanelets": len(lanelets),
        "links": sum(len(lanelet.successor) for lanelet in lanelets),
        "lights": len(scenario.lanelet_network.traffic_lights),
        "states": states,
        "problems": list(problems.planning_problem_dict),
        "ego": [row(state) for state in solution.trajectory.state_list],
    }
    print(json.dumps(found))
