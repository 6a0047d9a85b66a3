"""Folders for the recordings and for the lake converted from them."""

from __future__ import annotations

import pytest


@pytest.fixture
def raw(tmp_path):
    return tmp_path / "raw"


@pytest.fixture
def root(tmp_path):
    return tmp_path / "lake"
