"""The verbs of ``scenarionet info``, one per file."""
