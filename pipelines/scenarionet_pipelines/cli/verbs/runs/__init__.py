"""The verbs of ``scenarionet runs``, one per file."""
