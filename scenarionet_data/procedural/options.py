"""Options of the procedural generator; the defaults reproduce the figures of the paper's PG row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import option

BLOCK_NAMES = (
    "straight",
    "curve",
    "intersection",
    "t_intersection",
    "roundabout",
    "on_ramp",
    "off_ramp",
    "fork",
    "merge",
    "bidirection",
    "split",
    "bottleneck",
    "parking_lot",
    "toll_gate",
    "u_turn",
)

VERSIONS = "v1", "v2"
LETTERS = dict(zip("SCXTOrRFfBYyP$U", BLOCK_NAMES, strict=True))
"""Names of blocks by MetaDrive's letters. Its bottlenecks Y and y change both directions, our fork and merge one."""
_DEFAULT = "straight=2 curve=4 intersection=1.2 t_intersection=1.2 roundabout=1.2 on_ramp=2 off_ramp=2 fork=2 merge=2"
_ALL = f"{_DEFAULT} bidirection=1.2 split=2 bottleneck=2 parking_lot=1.2 toll_gate=1.2 u_turn=1.2"


@dataclass(frozen=True)
class GeneratorOptions:
    """Parameters of maps and traffic; with a seed, they determine a scenario."""

    version: str = option(
        "", "Traffic that enters and leaves (v2) or only leaves (v1); empty: as --version, else v2.", is_added=True
    )
    num_blocks: int = option(2, "Road blocks after the straight road the ego starts on.")
    blocks: str = option(
        _DEFAULT, "How often each kind is drawn, as name=weight; kinds left out never are; all: every kind, at times."
    )
    sequence: str = option(
        "", "The blocks in their order, by MetaDrive's letters SCXTOrRFfBYyP$U; empty: random ones.", is_added=True
    )
    density: float = option(1.5, "Vehicles per 100 m of lane; 15 in the paper's text, 1.5 in its database.")
    oncoming: float = option(0.25, "Share of the density on lanes that do not lead to the ego's destination.")
    pedestrians: float = option(0.5, "People per 100 m of sidewalk and crosswalk, in traffic v2.", is_added=True)
    cyclists: float = option(0.03, "Cyclists per other vehicle, in traffic v2.", is_added=True)
    parking: float = option(0.25, "Share of roads with parked cars beside them, in traffic v2.", is_added=True)
    construction: float = option(0.39, "Probability of road works or a breakdown with cones and barriers.")
    lights: float = option(0.7, "Probability that an intersection has traffic lights.")
    min_lanes: int = option(1, "Fewest lanes per direction.")
    max_lanes: int = option(3, "Most lanes per direction.")
    lane_width: float = option(3.5, "Width of a lane [m].")
    min_speed_limit: float = option(11.1, "Lowest speed limit of a map [m/s].")
    max_speed_limit: float = option(19.5, "Highest speed limit of a map [m/s].")
    left_hand: bool = option(False, "Whether traffic drives on the left: all is mirrored.", is_added=True)
    dt: float = option(0.1, "Time between timesteps [s].")
    max_steps: int = option(900, "Timesteps after which a scenario ends when the ego has not arrived.")

    @property
    def weights(self) -> Mapping[str, float]:
        """Weight of each kind of block.

        Raises:
            BadParameter: ``blocks`` is not a list of name=weight with a positive sum.
        """
        weights = dict.fromkeys(BLOCK_NAMES, 0.0)
        for word in (_ALL if self.blocks == "all" else self.blocks).replace(",", " ").split():
            name, _, text = word.partition("=")
            if name not in weights or not text.replace(".", "", 1).isdigit():
                raise BadParameter(f"blocks: {word!r}; wanted name=weight with a name of {', '.join(BLOCK_NAMES)}")
            weights[name] = float(text)
        if sum(weights.values()) <= 0.0:
            raise BadParameter(f"blocks: {self.blocks!r} draws nothing; give at least one kind a weight above 0")
        return weights

    def check(self) -> None:
        """Raise BadParameter at the first value outside its range."""
        _ = self.weights
        unknown = sorted(set(self.sequence) - set(LETTERS))
        if unknown:
            raise BadParameter(
                f"sequence: {self.sequence!r} has {', '.join(unknown)}; "
                f"wanted letters of {''.join(LETTERS)}, for example SXO"
            )
        if self.version not in ("", *VERSIONS):
            raise BadParameter(f"version: {self.version!r}; wanted {' or '.join(VERSIONS)}")
        ranges = {
            "num_blocks": (0, 20),
            "density": (0.0, 20.0),
            "oncoming": (0.0, 10.0),
            "pedestrians": (0.0, 20.0),
            "cyclists": (0.0, 1.0),
            "parking": (0.0, 1.0),
            "construction": (0.0, 1.0),
            "lights": (0.0, 1.0),
            "min_lanes": (1, self.max_lanes),
            "max_lanes": (self.min_lanes, 6),
            "lane_width": (2.8, 5.0),
            "min_speed_limit": (3.0, self.max_speed_limit),
            "max_speed_limit": (self.min_speed_limit, 40.0),
            "dt": (0.01, 0.2),
            "max_steps": (2, 100_000),
        }
        for name, (low, high) in ranges.items():
            if not low <= getattr(self, name) <= high:
                raise BadParameter(f"{name}: {getattr(self, name)}; wanted {low} to {high}")
