"""The bird's-eye view, against shapely pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_sim.sensors.bird_view import LIGHT_VALUES, BirdView, Channel, LightColor
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors import oracle
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401

KINDS = {
    Channel.VEHICLE: (ObjectType.VEHICLE,),
    Channel.PEDESTRIAN: (ObjectType.PEDESTRIAN,),
    Channel.CYCLIST: (ObjectType.CYCLIST,),
    Channel.OBJECT: (ObjectType.OTHER, ObjectType.TRAFFIC_CONE, ObjectType.TRAFFIC_BARRIER),
}


def pixel_centres(sensor, state, world, row):
    """(size, size, 2) positions [m] of the pixel centres, computed independently of the sensor."""
    ahead = (sensor.anchor[1] * sensor.size - np.arange(sensor.size) - 0.5)[:, None] * sensor.resolution
    right = (np.arange(sensor.size) + 0.5 - sensor.anchor[0] * sensor.size)[None] * sensor.resolution
    turned = state.heading[world, row] if sensor.heading_up else np.pi / 2
    x = np.cos(turned) * ahead + np.sin(turned) * right
    y = np.sin(turned) * ahead - np.cos(turned) * right
    return state.position[world, row] + np.stack([x, y], axis=-1)


def holds(shapes, places, border):
    """Return pixels whose centre is in a shape, and those too close to an outline for float32."""
    shape = shapely.unary_union(shapes)
    inside = shapely.contains_xy(shape, places[..., 0], places[..., 1])
    unsure = shapely.dwithin(shapely.boundary(shape), shapely.points(places), border)
    return inside, unsure


class TestBirdView(SensorConformance):
    sensor = BirdView(size=48, resolution=1.0, history=2)

    @pytest.mark.parametrize("heading_up", [True, False])
    def test_areas_and_boxes_agree_with_shapely(self, simulation, heading_up):  # noqa: F811
        sensor = BirdView(size=64, resolution=0.5, heading_up=heading_up, anchor=(0.5, 0.75))
        state, drawn = simulation.state, set()
        agents = simulation.agents[::3].copy()
        for (world, row), pictures in zip(agents, self.observed(simulation, sensor, agents), strict=True):
            places, roads = pixel_centres(sensor, state, world, row), simulation.batch.worlds[world].roads
            outlines = [
                shapely.make_valid(shapely.Polygon(o)) if len(o) > 2 else shapely.Point() for o in roads.polygons
            ]
            shapes = {
                Channel.ROAD: [o for o, is_road in zip(outlines, roads.is_road, strict=True) if is_road],
                Channel.CROSSWALK: [
                    o for o, t in zip(outlines, roads.polygon_type, strict=True) if t == MapFeatureType.CROSSWALK
                ],
                Channel.EGO: [oracle.box(state, world, row)],
            }
            for channel, kinds in KINDS.items():
                rows = [n for n in oracle.others(state, world, row) if state.object_type[world, n] in kinds]
                shapes[channel] = [oracle.box(state, world, n) for n in rows]
            for channel, wanted in shapes.items():
                inside, unsure = holds(wanted, places, 1e-4)
                np.testing.assert_array_equal((pictures[channel] == 255)[~unsure], inside[~unsure], str(channel))
                drawn |= {channel} if inside.any() else set()
        assert drawn >= {Channel.ROAD, Channel.EGO, Channel.VEHICLE, Channel.OBJECT}

    def test_every_line_has_its_channel(self, simulation):  # noqa: F811
        """Pixels on a line are set, and none more than a pixel away from it."""
        sensor, state, batch = BirdView(size=64, resolution=0.5), simulation.state, simulation.batch
        agents = simulation.agents[simulation.agents[:, 0] == 0][:3]
        for (world, row), pictures in zip(agents, self.observed(simulation, sensor, agents), strict=True):
            roads = batch.worlds[world].roads
            segments, types = roads.segments.reshape(-1, 2, 2), roads.segment_type
            for channel, is_kind in (
                (Channel.LANE_LINE, (types >= 16) & (types < 32)),
                (Channel.ROAD_EDGE, types >= 32),
            ):
                lines = shapely.unary_union(shapely.linestrings(segments[is_kind].astype(float)))
                places = pixel_centres(sensor, state, world, row)
                apart = shapely.distance(lines, shapely.points(places)) / sensor.resolution
                assert (pictures[channel] == 255).any()
                assert (apart[pictures[channel] == 255] <= np.sqrt(0.5) + 1e-6).all()
                assert (pictures[channel][1:-1, 1:-1][apart[1:-1, 1:-1] < 0.05] == 255).all()

    def test_history_shows_past_positions(self, simulation):  # noqa: F811
        """Past channels show the boxes at those moments in the current frame."""
        drive = simulate(make_drive(speed=8.0, others=(Other(15.0, 3.5, vx=5.0),)), steps=0, history=2)
        sensor = BirdView(size=60, resolution=0.5, history=2)
        ego, boxes = np.array([[0, 0]], np.int32), []
        assert not self.observed(drive, sensor, ego)[0, len(Channel) :].any()
        for _ in range(3):
            boxes.append([oracle.box(drive.state, 0, n) for n in (0, 1)])
            drive.step(np.zeros((2, 2)))
        pictures = self.observed(drive, sensor, ego)[0]
        places = pixel_centres(sensor, drive.state, 0, 0)
        for moment, shapes in enumerate((boxes[2], boxes[1])):
            inside, unsure = holds(shapes, places, 1e-4)
            assert inside.any()
            np.testing.assert_array_equal((pictures[len(Channel) + moment] == 255)[~unsure], inside[~unsure])
        drive.reset(0)
        assert not self.observed(drive, sensor, ego)[0, len(Channel) :].any()

    def test_history_longer_than_the_simulation_keeps_is_refused(self):
        with pytest.raises(BadParameter, match="pass history=2 to Simulation"):
            self.observed(simulate(make_drive(), history=1))

    def test_route_and_red_light_are_ahead(self):
        """Up to the light 20 m ahead, the column above the ego is its route; the light is a square of 2 m."""
        drive = simulate(make_drive(red=True), steps=0)
        sensor = BirdView(size=100, resolution=0.5)
        pictures = self.observed(drive, sensor)[0]
        assert (pictures[Channel.ROUTE, 0:50, 50] == 255).all()
        assert not pictures[Channel.ROUTE, 51:].any()
        red = pictures[Channel.LIGHT] == LIGHT_VALUES[LightColor.RED]
        rows, columns = np.nonzero(red)
        assert (rows.mean() + 0.5, columns.mean() + 0.5) == (10.0, 50.0)
        assert red.sum() == 16


@pytest.mark.parametrize("wrong", [{"size": 0}, {"resolution": 0.0}, {"history": -1}])
def test_parameters_out_of_range(wrong):
    with pytest.raises(BadParameter, match=next(iter(wrong))):
        BirdView(**wrong)
