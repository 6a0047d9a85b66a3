-- Scenarios in which a traffic light is recorded.
num_lights > 0
