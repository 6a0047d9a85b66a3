"""PufferDrive's binary maps: 91 timesteps of objects and the roads around them, as float32."""
