"""Changes between runs in words, for the terminal and for pages."""

from __future__ import annotations

from scenarionet_sim.evaluation.comparison import PairedChange


def mean_text(mean: float | None, scenarios: int) -> str:
    """A mean with its number of scenarios."""
    return "-" if mean is None else f"{mean:.4g} (n = {scenarios:,})"


def change_text(change: PairedChange | None) -> str:
    """A change with its interval and number of pairs."""
    if change is None:
        return "-"
    return f"{change.mean:+.4g} [{change.low:+.4g}, {change.high:+.4g}] (n = {change.scenarios:,})"
