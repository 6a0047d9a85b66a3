"""A lake in the browser: ``scenarionet browse``. The server is here, what runs in the browser lies in ``static/``."""
