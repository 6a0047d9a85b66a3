"""A lake on one page that opens anywhere: ``scenarionet report``. ``contents`` gathers, ``page`` writes."""

from scenarionet_pipelines.report.contents import Contents, gather
from scenarionet_pipelines.report.page import write

__all__ = ["Contents", "gather", "write"]
