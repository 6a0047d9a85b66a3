"""Distributions of measures as small SVG charts in the colours of the page."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_pipelines.report.markup import Markup, joined, tag
from scenarionet_pipelines.report.measures import MeasureDistribution

_WIDTH, _HEIGHT = 320, 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 40, 20, 8, 26
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


def histogram(spread: MeasureDistribution) -> Markup:
    """Draw the distribution of a measure: bars for one group, outlines for several."""
    most = max(float(spread.shares.max()), 1e-9)
    height = nice_ticks(0.0, most, 3)
    across = _Scale(float(spread.edges[0]), float(spread.edges[-1]), _LEFT, _WIDTH - _RIGHT)
    up = _Scale(0.0, max(most, height[-1]), _HEIGHT - _BOTTOM, _TOP)
    if len(spread.groups) == 1:
        drawn = [_bars(spread, across, up)]
    else:
        drawn = [_outline(spread, place, across, up) for place in range(len(spread.groups))]
    summary = "; ".join(f"{group.name}: most often {likeliest(spread, k)}" for k, group in enumerate(spread.groups))
    return tag(
        "svg", tag("title", f"{spread.title}: {summary}"), _grid(height, up, across), *drawn, _axis(across),
        viewBox=f"0 0 {_WIDTH} {_HEIGHT}", role="img", class_="histogram",
    )  # fmt: skip


class _Scale:
    """Linear map from values to coordinates of the chart."""

    def __init__(self, low: float, high: float, start: float, end: float) -> None:
        self.low, self.high = low, high
        self.start, self._factor = start, (end - start) / (high - low)

    def __call__(self, value: float) -> float:
        return round(self.start + (value - self.low) * self._factor, 2)


def nice_ticks(low: float, high: float, count: int) -> list[float]:
    """Return about ``count`` round numbers between low and high.

    Example:
        >>> nice_ticks(0.0, 47.0, 4)
        [0.0, 10.0, 20.0, 30.0, 40.0]
    """
    rough = (high - low) / count
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(float(power * factor) for factor in _STEPS if power * factor >= rough * 0.99)
    first = np.ceil(low / step - 1e-9)
    return [float(step * k) + 0.0 for k in np.arange(first, np.floor(high / step + 1e-9) + 1)]


def _grid(heights: list[float], up: _Scale, across: _Scale) -> Markup:
    right = across(across.high)
    return joined(
        *(tag("line", x1=_LEFT, x2=right, y1=up(value), y2=up(value), class_="grid") for value in heights),
        *(tag("text", f"{100 * value:g}%", x=_LEFT - 5, y=up(value) + 3.5, class_="tick end") for value in heights),
    )


def _axis(across: _Scale) -> Markup:
    bottom = _HEIGHT - _BOTTOM
    ticks = nice_ticks(across.low, across.high, 4)
    marks = [tag("line", x1=across(t), x2=across(t), y1=bottom, y2=bottom + 4, class_="axis") for t in ticks]
    words = [tag("text", f"{t:,.6g}", x=across(t), y=bottom + 16, class_="tick middle") for t in ticks]
    line = tag("line", x1=_LEFT, x2=across(across.high), y1=bottom, y2=bottom, class_="axis")
    return joined(line, *marks, *words)


def _bars(spread: MeasureDistribution, across: _Scale, up: _Scale) -> Markup:
    edges, shares = spread.edges, spread.shares[0]
    bottom = up(0.0)
    return joined(
        *(
            tag(
                "rect", tag("title", f"{_between(left, right)}: {share:.1%}"),
                x=across(left) + 0.5, width=max(round(across(right) - across(left) - 1, 2), 0.5),
                y=up(share), height=round(bottom - up(share), 2), class_="series-1 bar",
            )
            for (left, right), share in zip(pairwise(edges.tolist()), shares.tolist(), strict=True)
            if share
        )
    )  # fmt: skip


def _outline(spread: MeasureDistribution, place: int, across: _Scale, up: _Scale) -> Markup:
    edges: Float64 = np.repeat(spread.edges, 2)
    shares: Float64 = np.concatenate([[0.0], np.repeat(spread.shares[place], 2), [0.0]])
    points = " ".join(f"{across(x)},{up(y)}" for x, y in zip(edges.tolist(), shares.tolist(), strict=True))
    return tag("polyline", points=points, class_=f"series-{place % 8 + 1} outline")


def likeliest(spread: MeasureDistribution, place: int = 0) -> str:
    """Return the range of the bin with most scenarios of a group, as text."""
    bin_ = int(spread.shares[place].argmax())
    return _between(float(spread.edges[bin_]), float(spread.edges[bin_ + 1]))


def _between(left: float, right: float) -> str:
    if (left + 0.5).is_integer() and right - left == 1:
        return f"{left + 0.5:g}"
    return f"{left:.3g} to {right:.3g}"
