"""openpilot's protocol against comma's msgq and opendbc, in an environment of its own (`make test-openpilot`)."""
