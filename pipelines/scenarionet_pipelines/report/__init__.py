"""``scenarionet report``: a self-contained HTML page about a lake. ``contents`` collects, ``page`` renders."""

from scenarionet_pipelines.report.contents import ReportContents, gather
from scenarionet_pipelines.report.page import write

__all__ = ["ReportContents", "gather", "write"]
