"""Write scenarios for SUMO: a net, routes, the recorded motion as SUMO's FCD output, and a script to replay it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import ClassVar
from xml.sax.saxutils import quoteattr

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.sumo.motion import name_objects, write_motion, write_types
from scenarionet_data.interchange.sumo.net_writer import write_net
from scenarionet_data.interchange.sumo.routes import write_routes
from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True)
class SumoWriter:
    """Writes a net, types, routes, the recorded motion and a configuration a scenario, and replay.py for all of them.

    Scenarios with the same map share its net.
    """

    name: ClassVar[str] = "sumo"

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the files of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        features = scenario.map
        if features is None:
            raise InvalidScenario(scenario.id, "map", "expected a map, which SUMO demands, found none")
        net = write_net(scenario, features, losses)
        name = f"{stem}.net.xml"
        if scenario.map_id is not None:
            name = f"map-{hashlib.blake2b(net.text, digest_size=8).hexdigest()}.net.xml"
        names = name_objects(scenario, losses)
        losses.leave_out("egos, which are vehicles as others", 1)
        losses.leave_out("current timesteps", 1)
        losses.leave_out("objects of interest", len(scenario.objects_of_interest))
        losses.leave_out("tracks to predict", len(scenario.tracks_to_predict))
        end = scenario.timestamps[-1]
        config = (
            '<?xml version="1.0" encoding="UTF-8"?>\n<configuration>\n'
            f"<input><net-file value={quoteattr(name)}/><route-files value={quoteattr(stem + '.rou.xml')}/>"
            f"<additional-files value={quoteattr(stem + '.add.xml')}/></input>\n"
            f'<time><begin value="0"/><end value="{end:.3f}"/><step-length value="{scenario.dt:.3f}"/></time>\n'
            "</configuration>\n"
        )
        return {
            name: net.text,
            f"{stem}.rou.xml": write_routes(scenario, net, names, losses),
            f"{stem}.add.xml": write_types(scenario, names, losses),
            f"{stem}.fcd.xml": write_motion(scenario, names, losses),
            f"{stem}.sumocfg": config.encode(),
            "replay.py": files("scenarionet_data.interchange.sumo").joinpath("replay.py").read_bytes(),
        }
