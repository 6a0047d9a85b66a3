"""Draw the curves of an imitation run: ``python docs/make_driver_picture.py LAKE RUN [FILE]``.

Above, the deviation of each control from the teacher's, as learned; below, what the episodes achieved that ended in 20
rounds. Both are rows of the view ``training``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import polars as pl
from matplotlib.figure import Figure

from scenarionet_data import Lake

PICTURE = Path(__file__).parent / "pictures" / "imitation.svg"
_ROUNDS = 20


def draw(lake: Lake, run: str, path: Path) -> None:
    """Write the picture of a run."""
    rows = lake.sql(
        "SELECT round, steps, episodes, success, cost, learned FROM training "
        f"WHERE run = '{run}' AND test IS NULL ORDER BY round"
    )
    figure = Figure(figsize=(7, 5.5), layout="constrained")
    errors, episodes = figure.subplots(2, 1, sharex=True)
    learned = [json.loads(text) for text in rows["learned"]]
    for name in ("steering_error", "throttle_error"):
        errors.plot(rows["steps"], [each[name] for each in learned], label=name.replace("_", " "))
    errors.set(yscale="log", ylabel="of the range of 1")
    weighed = rows.group_by((pl.col("round") - 1) // _ROUNDS, maintain_order=True).agg(
        pl.col("steps").max(),
        *((pl.col(name) * pl.col("episodes")).sum() / pl.col("episodes").sum() for name in ("success", "cost")),
    )
    episodes.plot(weighed["steps"], weighed["success"], label="success")
    episodes.plot(weighed["steps"], weighed["cost"], label="crashes per episode")
    episodes.set(xlabel="steps", ylim=(0.0, 1.0))
    for place in (errors, episodes):
        place.legend()
        place.grid(alpha=0.3)
    figure.savefig(path)


if __name__ == "__main__":
    draw(Lake(sys.argv[1]), sys.argv[2], Path(sys.argv[3]) if len(sys.argv) > 3 else PICTURE)
