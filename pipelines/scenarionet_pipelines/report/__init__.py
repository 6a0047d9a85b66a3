"""``scenarionet report``: a self-contained HTML page about a lake. ``contents`` collects, ``page`` renders."""
