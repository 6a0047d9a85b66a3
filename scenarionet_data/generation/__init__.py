"""Traffic that a trained model makes on recorded maps, after TrafficGen (Feng et al. 2023).

``snapshots`` reads moments of scenarios as tensors, ``traffic_model`` has the networks, ``training`` trains them,
``driving`` places vehicles and moves them, ``writing`` writes scenarios into the lake, and ``scores`` compares them
with the recordings. All but ``discrepancy`` needs torch.
"""
