"""The catalogue of disturbances: what happens to egos, how often per kilometre and hour, with which parameters.

``gathering`` finds the disturbances of ``sql/disturbances`` in a lake, ``figures`` counts them, and ``packing`` writes
them without recordings, so that anybody who has the recordings can compute them again and compare.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_data.catalogue.figures import FIGURES as FIGURES
    from scenarionet_data.catalogue.figures import Figure as Figure
    from scenarionet_data.catalogue.figures import compute_figures as compute_figures
    from scenarionet_data.catalogue.gathering import Catalogue as Catalogue
    from scenarionet_data.catalogue.gathering import gather_catalogue as gather_catalogue
    from scenarionet_data.catalogue.packing import compare_catalogue as compare_catalogue
    from scenarionet_data.catalogue.packing import write_catalogue as write_catalogue

__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)
