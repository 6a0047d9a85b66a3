"""HTML in notebooks for classes of lower layers, which do not import what draws it."""

from __future__ import annotations

import importlib


class HasCard:
    """An object that notebooks show as HTML, made by :mod:`scenarionet_data.display`."""

    def _repr_html_(self) -> str:
        html: str = importlib.import_module("scenarionet_data.display").card(self)
        return html
