"""The verbs of ``scenarionet tables``, one per file."""
