"""Arrow without pandas until somebody imports pandas; modules that are hidden for a while."""

from __future__ import annotations

import importlib
import subprocess
import sys
import threading

import pytest

from scenarionet_data.optional_imports import hidden

pytestmark = pytest.mark.integration

USE = """
import sys
from scenarionet_data.schema import tables
import pyarrow as pa
pa.array([1.0]).to_numpy(), pa.table({"a": [1]}), pa.scalar("a")
"""
WITHOUT = USE + "assert 'pandas' not in sys.modules\n"
AFTERWARDS = """
assert pa.array(pandas.Series([1.0, None])).null_count == 1  # for Arrow without pandas, NaN is a number
assert isinstance(pa.table({"a": [1]}).to_pandas(), pandas.DataFrame)
assert pa.Table.from_pandas(pandas.DataFrame({"a": [1]})).column_names == ["a"]
assert not [finder for finder in sys.meta_path if type(finder).__module__.startswith("scenarionet")]
assert pandas.__spec__.name == "pandas"
"""


@pytest.mark.parametrize(
    "program",
    [
        WITHOUT + "import pandas" + AFTERWARDS,
        WITHOUT + "from pandas.api import types\nimport pandas" + AFTERWARDS,
        WITHOUT + "pa.nulls(1).to_pandas(); pandas = sys.modules['pandas']" + AFTERWARDS,
        "import pandas" + USE + AFTERWARDS,
        "import pyarrow; pyarrow.array([1])" + USE + "import pandas" + AFTERWARDS,
    ],
    ids=["imported later", "a module of it", "by Arrow itself", "imported before", "Arrow asked before"],
)
def test_arrow_knows_pandas_once_it_is_imported_and_not_before(program):
    pytest.importorskip("pandas")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_loading_imports_neither_pandas_nor_duckdb(lake):
    """They would take half of the time to load the first scenario."""
    program = (
        f"import sys; from scenarionet_data import ScenarioLoader; ScenarioLoader({str(lake.root)!r})[0]; "
        "print(sorted({'pandas', 'duckdb', 'polars', 'coverage', 'scipy'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_module_is_deferred_until_one_of_its_names_is_used():
    program = (
        "import sys; from scenarionet_data.schema import tables; import pyarrow as pa; import pyarrow.compute as pc; "
        "assert 'pyarrow._compute' not in sys.modules; assert pc.__name__ == pc.__spec__.name == 'pyarrow.compute'; "
        "from pyarrow.compute import field; assert pc.sum(pa.array([1, 2])).as_py() == 3; "
        "assert pa.compute is sys.modules['pyarrow.compute'] is not pc; assert pc.sum is pa.compute.sum; "
        "assert hasattr(pc, 'nothing') is False"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_modules_are_hidden_in_one_thread_for_a_while():
    found = []
    sys.modules.pop("this_is_hidden", None)
    with hidden("colorsys"):
        sys.modules.pop("colorsys", None)
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module("colorsys")
        thread = threading.Thread(target=lambda: found.append(importlib.import_module("colorsys")))
        thread.start()
        thread.join()
    assert found == [importlib.import_module("colorsys")]
