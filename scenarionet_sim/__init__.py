"""The simulator: Gymnasium environments over the scenarios of a lake.

Importing this package registers ``ScenarioNet-v0`` (also as a vector environment) with Gymnasium, if that is
installed; the parts are in the modules.
"""

from importlib.util import find_spec

if find_spec("gymnasium"):
    from scenarionet_sim.environments import registration as registration
