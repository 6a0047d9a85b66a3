"""Pictures and videos from above: of a recording, or of a simulation while it runs.

Needs matplotlib (extra ``plots``), and PyAV for mp4 (extra ``video``); no display.
"""

from scenarionet_data.errors import MissingDependency

try:
    import matplotlib as _matplotlib  # noqa: F401
except ImportError as error:
    raise MissingDependency("pictures need matplotlib; install scenarionet-lake[plots]") from error

from scenarionet_sim.render.drawing import Drawing
from scenarionet_sim.render.files import write_picture, write_video
from scenarionet_sim.render.live import Live
from scenarionet_sim.render.moment import Moment
from scenarionet_sim.render.rollouts import rolled_out
from scenarionet_sim.render.topdown import TopDown
from scenarionet_sim.render.window import Window

__all__ = ["Drawing", "Live", "Moment", "TopDown", "Window", "rolled_out", "write_picture", "write_video"]
