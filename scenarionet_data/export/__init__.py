"""Export databases as ScenarioNet pickles, which MetaDrive and ScenarioNet read without changes; others by name.

Other formats are in ``scenarionet_data.interchange``.

The format of pickles matches MetaDrive 0.4.3 and ScenarioNet (2025-03). Pickles of every version are read by a
converter, ``scenarionet_data.converters.scenarionet``.

    describe   one scenario as a dictionary            summary    the statistics that ScenarioNet's filters read
    maps       its map features and lights             sanity     the check of every written dictionary
    pickling   scenarios to files                      parts      the same, by several workers
    write      a database of pickles on disk
"""

from __future__ import annotations

from scenarionet_data.export.describe import to_pickle_dict
from scenarionet_data.export.sanity import sanity_check
from scenarionet_data.export.write import export, export_database
from scenarionet_data.interchange.base import ExportReport

__all__ = ["ExportReport", "export", "export_database", "sanity_check", "to_pickle_dict"]
