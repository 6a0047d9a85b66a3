"""openpilot's protocol: frames over VisionIPC, messages of its schema over msgq, CAN of a Honda Civic of 2022."""
