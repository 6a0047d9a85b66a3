"""The verbs of ``scenarionet forecast``, one per file."""
