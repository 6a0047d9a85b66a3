"""``scenarionet browse``: a local web server for a lake, and its page in ``static/``."""
