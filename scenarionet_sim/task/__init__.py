"""The driving task: reward, termination and running statistics of an episode."""
