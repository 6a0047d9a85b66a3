"""The verbs of ``scenarionet maintain``, one per file."""
