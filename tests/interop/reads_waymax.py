"""Read TFRecord files as Waymax does, and write the arrays of its state: runs in the environment of Waymax.

usage: reads_waymax.py OUT.npz FILE.tfrecord...
"""

import sys

import numpy as np
from waymax import config, dataloader


def main(target: str, files: list[str]) -> None:
    found = {}
    for number, file in enumerate(files):
        settings = config.DatasetConfig(
            path=file, max_num_objects=128, max_num_rg_points=30_000, include_sdc_paths=True, num_paths=45,
            num_points_per_path=800, repeat=1,
        )  # fmt: skip
        (state,) = dataloader.simulator_state_generator(settings)
        parts = {
            "log": state.log_trajectory, "objects": state.object_metadata, "roads": state.roadgraph_points,
            "lights": state.log_traffic_light, "paths": state.sdc_paths,
        }  # fmt: skip
        for part, values in parts.items():
            for name in values.__dataclass_fields__:
                found[f"{number}/{part}/{name}"] = np.asarray(getattr(values, name))
    np.savez(target, **found)


main(sys.argv[1], sys.argv[2:])
