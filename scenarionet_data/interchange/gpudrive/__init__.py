"""GPUDrive's and Nocturne's JSON: one file a scenario, with absolute coordinates and 91 timesteps."""
