-- Scenarios without a recorded traffic light.
num_lights = 0
