"""Texts are those of Arrow, in parts, joined and with nulls."""

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.columns import Texts

LISTED = st.lists(st.none() | st.text(max_size=5), max_size=8)


@given(first=LISTED, second=LISTED, skipped=st.integers(0, 8))
def test_texts_are_those_of_arrow(first, second, skipped):
    texts = [Texts.from_arrow(pa.array(listed, pa.string()).slice(skipped)) for listed in (first, second)]
    kept = [listed[skipped:] for listed in (first, second)]
    assert [found.strings().tolist() for found in texts] == kept
    assert Texts.joined(texts).strings().tolist() == kept[0] + kept[1]
    assert texts[0].part(1, len(kept[0])).strings().tolist() == kept[0][1:] if kept[0] else True


def test_other_bytes_are_refused():
    binary = pa.array([b"\xff"], pa.binary())
    with pytest.raises(pa.ArrowInvalid, match="UTF8"):
        Texts.from_arrow(pa.Array.from_buffers(pa.string(), 1, binary.buffers()))
