"""Run by an interpreter with torch: measure UniTraj's samples per second of processor time, and write them as JSON.

usage: python unitraj_speed.py CHECKOUT CONFIG PICKLE..., where CONFIG is JSON

Scenarios are read and preprocessed by UniTraj's own code, as for its cache, which is not written.
"""

from __future__ import annotations

import json
import statistics
import sys
import time

from unitraj_reference import Config, samples


def main(checkout: str, config: str, *paths: str) -> None:
    """Make the samples of each scenario; the first one imports torch."""
    times = []
    for path in paths:
        started = time.process_time()
        count = sum(1 for _ in samples(checkout, Config(json.loads(config)), [path]))
        times.append((time.process_time() - started) / max(count, 1))
    sys.stdout.write("RESULT" + json.dumps({"rate": 1 / statistics.median(times[1:])}) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
