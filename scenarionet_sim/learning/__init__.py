"""Reinforcement and imitation learning on the batch engine; its modules need the extra ``learn`` (torch).

``config`` and ``driver`` do not: settings and trained drivers work without torch.
"""
