"""A lake on one page that opens anywhere: ``scenarionet report``. ``contents`` gathers, ``page`` writes."""

from pipelines.report.contents import Contents, gather
from pipelines.report.page import write

__all__ = ["Contents", "gather", "write"]
