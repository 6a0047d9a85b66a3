"""Open Lanelet2 maps with the lanelet2 package; print links, neighbours and rules of each as a line of JSON."""

import json
import sys

import lanelet2

projector = lanelet2.projection.UtmProjector(lanelet2.io.Origin(49.0, 8.4))
rules = lanelet2.traffic_rules.create(
    lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle
)
for name in sys.argv[1:]:
    road_map, errors = lanelet2.io.loadRobust(name, projector)
    bikes = lanelet2.traffic_rules.create(
        lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Bicycle
    )
    graphs = [lanelet2.routing.RoutingGraph(road_map, each) for each in (rules, bikes)]
    lanes = {lane.id: lane for lane in road_map.laneletLayer if lane.attributes["subtype"] != "crosswalk"}
    links, beside, places = set(), set(), {}
    for number, lane in lanes.items():
        for graph in graphs:
            links.update((number, other.id) for other in graph.following(lane, False))
            for other in (graph.right(lane), graph.adjacentRight(lane)):
                if other is not None:
                    beside.add((number, other.id))
        places[number] = [[point.x, point.y] for point in (lane.leftBound[0], lane.rightBound[-1])]
    found = {
        "errors": list(errors), "lanes": len(lanes), "links": sorted(links), "beside": sorted(beside), "places": places,
        "rules": sorted(type(rule).__name__ for lane in lanes.values() for rule in lane.regulatoryElements),
    }  # fmt: skip
    print(json.dumps(found))
