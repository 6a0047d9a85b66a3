"""Variations of recorded scenarios: other speeds, gaps, start times, places, sizes, road users and light phases.

``parameters`` draws values, ``changes`` applies them to a scenario, ``limits`` says what cannot be, ``drawing`` makes
variations as they are needed, and ``writing`` writes them into the lake, as any converter does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_data.variations.changes import change as change
    from scenarionet_data.variations.drawing import VariationSpace as VariationSpace
    from scenarionet_data.variations.drawing import variations_of as variations_of
    from scenarionet_data.variations.moment_scenarios import CutMoments as CutMoments
    from scenarionet_data.variations.moment_scenarios import MomentChoice as MomentChoice
    from scenarionet_data.variations.moment_scenarios import cut_moments as cut_moments
    from scenarionet_data.variations.parameters import VariedParameter as VariedParameter
    from scenarionet_data.variations.parameters import draw as draw
    from scenarionet_data.variations.parameters import parse_parameters as parse_parameters
    from scenarionet_data.variations.writing import vary as vary

__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)
