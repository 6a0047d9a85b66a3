"""The verbs of ``scenarionet db``, one per file."""
