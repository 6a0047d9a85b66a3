"""Images of simulations: converts worlds and states to what :mod:`scenarionet_data.plots` draws.

Needs matplotlib (extra ``plots``), and PyAV for mp4 (extra ``video``); only windows need a display.
"""

from scenarionet_sim.render.live import Live
from scenarionet_sim.render.rollouts import rollout_moments
from scenarionet_sim.render.scenes import moment_of, scene_of
from scenarionet_sim.render.space import SPACE_VIEWS, Film, recorded_moments

__all__ = ["SPACE_VIEWS", "Film", "Live", "moment_of", "recorded_moments", "rollout_moments", "scene_of"]
