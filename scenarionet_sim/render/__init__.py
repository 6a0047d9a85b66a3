"""Pictures of simulations: the drawing is :mod:`scenarionet_data.plots`, here is what a simulation gives it.

Needs matplotlib (extra ``plots``), and PyAV for mp4 (extra ``video``); no display but for a window.
"""

from scenarionet_sim.render.live import Live
from scenarionet_sim.render.rollouts import rollout_moments
from scenarionet_sim.render.scenes import moment_of, scene_of

__all__ = ["Live", "moment_of", "rollout_moments", "scene_of"]
