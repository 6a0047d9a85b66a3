"""Seeds to scenarios: the conformance suite, ranges, options, and what 1,000 default scenarios look like."""

from __future__ import annotations

import pytest

from scenarionet_data.converters.pg import Procedural, ProceduralOptions
from scenarionet_data.testing import ConverterConformance


class TestProcedural(ConverterConformance):
    converter = Procedural()
    damaged_glob = None

    @pytest.fixture
    def raw(self) -> str:
        return "0:6"


def shards(raw, **options):
    return list(Procedural().shards(raw, "train", "v1", ProceduralOptions(**options)))
