"""Lanelet2 maps read with the standard library alone: lanelets, routes along them, and lights by their rules' ids."""

import heapq
import math
import xml.etree.ElementTree as ElementTree
from itertools import pairwise


def resampled(line, count):
    """A line as so many points at equal distances."""
    arcs = [0.0]
    for a, b in pairwise(line):
        arcs.append(arcs[-1] + math.dist(a, b))
    points, at = [], 0
    for k in range(count):
        arc = arcs[-1] * k / (count - 1)
        while at < len(line) - 2 and arcs[at + 1] < arc:
            at += 1
        share = (arc - arcs[at]) / max(arcs[at + 1] - arcs[at], 1e-9)
        points.append(tuple(a + share * (b - a) for a, b in zip(line[at], line[at + 1], strict=True)))
    return points


class Lanelets:
    def __init__(self, path):
        root = ElementTree.parse(path).getroot()
        tags = {id(each): {tag.get("k"): tag.get("v") for tag in each.iter("tag")} for each in root}
        nodes = {
            each.get("id"): (float(tags[id(each)]["local_x"]), float(tags[id(each)]["local_y"]))
            for each in root.iter("node")
        }
        ways = {each.get("id"): [nd.get("ref") for nd in each.iter("nd")] for each in root.iter("way")}
        self.lines, self.limits, self.lights, sides = {}, {}, {}, {}
        for each in root.iter("relation"):
            told, name = tags[id(each)], each.get("id")
            of = {role: [m.get("ref") for m in each.iter("member") if m.get("role") == role] for role in
                  ("left", "right", "ref_line")}  # fmt: skip
            if told.get("type") == "lanelet" and told.get("subtype") != "crosswalk":
                sides[name] = of["left"][0], of["right"][0]
                left, right = ([nodes[ref] for ref in ways[way]] for way in sides[name])
                count = max(2, int(max(math.dist(left[0], left[-1]), math.dist(right[0], right[-1]))) + 1)
                pairs = zip(resampled(left, count), resampled(right, count), strict=True)
                self.lines[name] = [((a + c) / 2, (b + d) / 2) for (a, b), (c, d) in pairs]
                self.limits[name] = float(told["speed_limit"]) / 3.6 if "speed_limit" in told else None
            elif told.get("subtype") == "traffic_light":
                stops = [[nodes[ref] for ref in ways[way]] for way in of["ref_line"]]
                self.lights[int(name)] = [
                    tuple(sum(axis) / len(line) for axis in zip(*line, strict=True)) for line in stops
                ]
        starts, by_left, by_right = {}, {}, {}
        for name, (left, right) in sides.items():
            starts.setdefault((ways[left][0], ways[right][0]), []).append(name)
            by_left.setdefault(left, []).append(name)
            by_right.setdefault(right, []).append(name)
        self.next = {name: starts.get((ways[a][-1], ways[b][-1]), []) for name, (a, b) in sides.items()}
        self.beside = {name: by_left.get(b, []) + by_right.get(a, []) for name, (a, b) in sides.items()}

    def near(self, x, y, heading):
        """Lanelets at a pose, by distance [m], and the nearest point of each."""
        found = []
        for name, line in self.lines.items():
            k = min(range(len(line) - 1), key=lambda k: math.dist(line[k], (x, y)))
            (ax, ay), (bx, by) = line[k], line[k + 1]
            turned = math.remainder(math.atan2(by - ay, bx - ax) - heading, 2.0 * math.pi)
            if (distance := math.dist((ax, ay), (x, y))) < 5.0 and abs(turned) < 1.0:
                found.append((distance, name, k))
        return sorted(found)

    def route(self, start, goal):
        """Points and speed limit from pose to pose along the lanelets; None without a way."""
        ends = {name: (distance, k) for distance, name, k in self.near(*goal)}
        queue, seen = [(3.0 * distance, name, k, ()) for distance, name, k in self.near(*start)], set()
        heapq.heapify(queue)
        best = None
        while queue:
            cost, name, k, before = heapq.heappop(queue)
            if best and cost >= best[0]:
                break
            if (name, k) in seen:
                continue
            seen.add((name, k))
            line = self.lines[name]
            if name in ends and ends[name][1] >= k:
                distance, last = ends[name]
                total = cost + last - k + 3.0 * distance
                if best is None or total < best[0]:
                    best = total, (*before, (name, k, last + 1))
            for other in self.next[name]:
                heapq.heappush(queue, (cost + len(line) - k, other, 0, (*before, (name, k, len(line) - 1))))
            for other in self.beside[name]:
                at = min(k + 10, len(line) - 1)
                to = min(range(len(self.lines[other])), key=lambda j: math.dist(self.lines[other][j], line[at]))
                heapq.heappush(queue, (cost + at - k + 20.0, other, to, (*before, (name, k, k + 1))))
        if best is None:
            return None
        limits = [self.limits[name] for name, _, _ in best[1] if self.limits[name]]
        points = [point for name, first, last in best[1] for point in self.lines[name][first:last]]
        return [*points, goal[:2]], min(limits) if limits else None
