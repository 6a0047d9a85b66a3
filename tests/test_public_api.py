"""The public names; a misspelt keyword is an error in every public function and method."""

from __future__ import annotations

import dataclasses
import gc
import importlib
import inspect
import pkgutil
import subprocess
import sys
import typing

import pytest

import scenarionet_data
from scenarionet_data import Database, Lake, ScenarioLoader
from scenarionet_data.errors import ScenarioNetError
from scenarionet_data.public_names import paused_collector
from scenarionet_data.scenario import settings
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

PACKAGES = ("scenarionet_data", "scenarionet_sim", "scenarionet_pipelines")

FORWARDED = {
    "scenarionet_data.plots.artists.Strokes.__init__": "to matplotlib",
    "scenarionet_data.plots.artists.Pieces.__init__": "to matplotlib",
    "scenarionet_data.plots.artists.Marks.__init__": "to matplotlib",
    "scenarionet_data.plots.artists.areas": "to matplotlib",
    "scenarionet_data.procedural.roadmap.Block.add_lane": "to the dataclass Lane",
    "scenarionet_data.storage.files.fsspec_adapter.RemoteFilesystem.info": "signature of fsspec",
    "scenarionet_data.storage.files.fsspec_adapter.RemoteFilesystem.glob": "signature of fsspec",
    "scenarionet_data.interchange.ros.messages.RosMessages.make": "to the message of rosbags",
    "scenarionet_data.interchange.ros.messages.RosMessages._marker": "to the message of rosbags",
    "scenarionet_sim.environments.single_agent.ScenarioNetEnv.__init__": "to the dataclass EnvConfig",
    "scenarionet_sim.environments.multi_agent.ScenarioNetParallelEnv.__init__": "to the dataclass EnvConfig",
    "scenarionet_sim.environments.multi_agent.not_for_gymnasium": "refuses all of them",
    "scenarionet_sim.environments.vector.ScenarioNetVectorEnv.__init__": "to the dataclass EnvConfig",
    "scenarionet_sim.environments.vector.ScenarioNetVectorEnv.close_extras": "signature of Gymnasium",
    "scenarionet_sim.environments.stable_baselines.StableBaselinesEnv.env_method": "signature of Stable-Baselines3",
    "scenarionet_pipelines.cli.verb.VerbCommand.run": "parsed values",
    "scenarionet_pipelines.cli.verb.argument": "to click",
    "scenarionet_pipelines.cli.verb.option": "to click",
    "scenarionet_pipelines.cli.group.Verbs.__init__": "to click",
    "scenarionet_pipelines.report.markup.tag": "attributes of an HTML element",
}
"""Functions with ``**`` parameters, and what rejects unknown names or uses any of them."""


def defined():
    """Modules, and name and value of what each defines."""
    for package in map(importlib.import_module, PACKAGES):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            try:
                module = importlib.import_module(found.name)
            except ModuleNotFoundError as error:  # an optional dependency
                assert (error.name or "").split(".")[0] not in PACKAGES, found.name
                continue
            for name, value in vars(module).items():
                if getattr(value, "__module__", None) == module.__name__:
                    yield module, name, value


def public_functions():
    """Public functions and methods, and constructors, by qualified name."""
    for module, name, value in defined():
        if name.startswith("_"):
            continue
        members = vars(value).items() if inspect.isclass(value) else ()
        functions = [(name, value)] if inspect.isfunction(value) else []
        for member, attribute in members:
            function = getattr(attribute, "__func__", attribute)
            is_public = not member.startswith("_") or member == "__init__"
            if is_public and inspect.isfunction(function) and function.__module__ == module.__name__:
                functions.append((f"{name}.{member}", function))
        for qualified, function in functions:
            yield f"{module.__name__}.{qualified}", function


def test_no_public_function_accepts_arbitrary_keywords():
    swallowing = {
        name
        for name, function in public_functions()
        if any(each.kind is each.VAR_KEYWORD for each in inspect.signature(function).parameters.values())
    }
    assert swallowing - set(FORWARDED) == set()


def test_a_setting_with_another_default_stays_within_its_bounds():
    """The check reads the annotation of the class itself: one without the bound of its parent's takes any number."""
    bounds = {name for name, value in vars(settings).items() if typing.get_origin(value) is typing.Annotated}

    def bounded(cls):
        annotations = vars(cls).get("__annotations__", {})
        return {name for name, kind in annotations.items() if str(kind).removesuffix(" | None") in bounds}

    classes = {value for _, _, value in defined() if inspect.isclass(value) and dataclasses.is_dataclass(value)}
    assert sum(map(len, map(bounded, classes))) > 50, "settings are annotated otherwise"
    lost = {
        f"{cls.__module__}.{cls.__qualname__}.{name}"
        for cls in classes
        for parent in cls.__mro__[1:]
        for name in bounded(parent) & set(vars(cls).get("__annotations__", {})) - bounded(cls)
    }
    assert lost == set()


def test_errors_come_back_from_workers():
    """One that cannot be unpickled looks as if the worker had been killed."""
    errors = {each for _, _, each in defined() if inspect.isclass(each) and issubclass(each, ScenarioNetError)}
    errors = {each for each in errors if ".web." not in each.__module__}  # which answers in its own process
    assert len(errors) > 20
    for kind in errors:
        parameters = inspect.signature(kind).parameters.values()
        error = kind(*(each.name for each in parameters if each.default is each.empty))
        make, given = error.__reduce__()[:2]  # as pickle does, unless Dask has taught it another way
        again = make(*given)
        assert (type(again), str(again)) == (kind, str(error))


@pytest.fixture
def lake_of_three(tmp_path):
    return write_lake(tmp_path / "lake", [make_scenario(k, num_steps=6, num_lanes=1) for k in range(3)])


@pytest.mark.parametrize("kind", [Lake, Database, ScenarioLoader])
def test_methods_are_defined_in_place_with_docstrings(kind):
    classes = [each for each in kind.__mro__ if each.__module__.startswith("scenarionet_data")]
    methods = {name: value for each in classes for name, value in vars(each).items() if inspect.isfunction(value)}
    methods.pop("__replace__", None)  # of dataclasses, from Python 3.13 on
    wrong = [name for name, value in methods.items() if not value.__qualname__.endswith(f".{name}")]
    assert wrong == []
    assert [name for name, value in methods.items() if not name.startswith("_") and not value.__doc__] == []


@pytest.mark.parametrize(
    "call",
    [
        lambda lake: lake.filter("true", name="x", parant="busy"),
        lambda lake: lake.select("true", parant="busy"),
        lambda lake: lake.sample(n=2, name="x", sead=3),
        lambda lake: lake.split(None, {"a": 1.0}, prefix="x"),
        lambda lake: lake.merge("a", "b", name="x", replase=True),
        lambda lake: lake.copy("a", name="x", replase=True),
        lambda lake: lake.arrow("SELECT 1", boxes=None),
        lambda lake: lake.select().filter(name="x", where_="true"),
    ],
)
def test_misspelt_keyword_is_a_type_error(call, lake_of_three):
    with pytest.raises(TypeError, match="unexpected keyword argument"):
        call(lake_of_three)
    assert lake_of_three.databases == []


def test_public_names_are_listed_and_imported_on_demand():
    names = scenarionet_data.__all__
    assert len(set(names)) == len(names) <= 55
    assert dir(scenarionet_data) == sorted(names)
    assert {name for name in names if getattr(scenarionet_data, name, None) is None} == set()
    assert scenarionet_data.__version__[0].isdecimal()
    with pytest.raises(AttributeError, match=r"has no 'Lakes'; it has .*Lake"):
        _ = scenarionet_data.Lakes
    code = (
        "import sys, scenarionet_data; print([n for n in ('duckdb', 'numba', 'pyarrow', 'numpy') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_garbage_collector_is_as_before_after_an_import():
    for was_enabled in (True, False):
        (gc.enable if was_enabled else gc.disable)()
        try:
            with pytest.raises(ImportError), paused_collector():
                assert not gc.isenabled()
                raise ImportError
            assert gc.isenabled() == was_enabled
        finally:
            gc.enable()
