"""Logical scenarios: a road, road users and parameters in a TOML file, of which concrete scenarios are made.

``description`` reads the file, ``expressions`` computes its texts, ``roads`` draws the road, ``motion`` moves all road
users of many concrete scenarios at once, ``converter`` makes scenarios of them, and ``fitting`` fits their parameters.
``library`` has the files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_data.logical.converter import Logical as Logical
    from scenarionet_data.logical.converter import concrete as concrete
    from scenarionet_data.logical.description import LogicalScenario as LogicalScenario
    from scenarionet_data.logical.description import read_logical as read_logical
    from scenarionet_data.logical.fitting import fit_logical as fit_logical
    from scenarionet_data.logical.motion import Motions as Motions
    from scenarionet_data.logical.motion import move as move

__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)
