"""The verbs of ``scenarionet traffic``, one per file."""
