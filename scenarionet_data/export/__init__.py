"""ScenarioNet's pickles, written: databases of ours that MetaDrive and ScenarioNet open without a change there.

The format is theirs (MetaDrive 0.4.3, ScenarioNet of 2025-03); this package writes one form of it. Reading
pickles, of every vintage, is a conversion like any other: ``scenarionet_data.converters.scenarionet``.

    describe   one scenario as their dictionary        summary    the statistics their filters read
    maps       its map features and lights             sanity     the check every written dictionary passes
    pickling   scenarios to files                      parts      many of them, by several workers
    write      a database of pickles on disk
"""

from __future__ import annotations

from scenarionet_data.export.describe import to_pickle_dict
from scenarionet_data.export.sanity import sanity_check
from scenarionet_data.export.write import ExportReport, export, export_database

__all__ = ["ExportReport", "export", "export_database", "sanity_check", "to_pickle_dict"]
