"""``scenarionet report``: a self-contained HTML page about a lake. ``contents`` collects, ``page`` renders."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_pipelines.report.contents import ReportContents as ReportContents
    from scenarionet_pipelines.report.contents import gather as gather
    from scenarionet_pipelines.report.page import write as write

# Comparisons in words need no matplotlib.
__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)
