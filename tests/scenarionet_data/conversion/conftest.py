"""Where recordings and the lake made of them lie."""

from __future__ import annotations

import pytest


@pytest.fixture
def raw(tmp_path):
    return tmp_path / "raw"


@pytest.fixture
def root(tmp_path):
    return tmp_path / "lake"
