"""The command line as a whole: light imports, documented verbs, one-line errors and exit codes."""

from __future__ import annotations

import shlex
import subprocess
import sys

import click
import pytest

from scenarionet_data import version
from scenarionet_pipelines.cli.group import find_verb
from scenarionet_pipelines.messages import one_line
from scenarionet_pipelines.verb_tree import GROUPS, SECTIONS
from tests.scenarionet_pipelines.conftest import run

TOP = [name for names in SECTIONS.values() for name in names]
GROUPED = [f"{group} {name}" for group, (_, names) in GROUPS.items() for name in names]
ALL_VERBS = TOP + GROUPED


# --- help ---------------------------------------------------------------------------------------------------


def test_help_imports_no_heavy_package():
    heavy = ["pyarrow", "duckdb", "numba", "numpy", "polars", "shapely", "rich", "dask"]
    code = (
        "import sys, scenarionet_pipelines.cli, click.testing as t\n"
        "r = t.CliRunner().invoke(scenarionet_pipelines.cli.cli, ['--help']); assert r.exit_code == 0\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_small_questions_import_nothing_that_they_do_not_need(lake, ok):
    """Numba, Polars and the functions of Arrow take as long to import as a question about a small lake."""
    ok("filter", lake, "--name", "few")
    heavy = ["numba", "llvmlite", "polars", "pandas", "pyarrow._compute", "scipy", "rich", "dask", "multiprocessing"]
    saving = ["scenarionet_data.lake.lake", "scenarionet_data.operations.database_query"]  # which only filter needs
    code = (
        "import sys, scenarionet_pipelines.cli, click.testing as t\n"
        f"heavy = {heavy + saving}\n"
        "for words in (['list'], ['show', '11'], ['sql', 'summary'], ['filter', '--name', 'same']):\n"
        f"    heavy = {heavy} if words[0] == 'filter' else heavy\n"
        f"    words.insert(1, {str(lake)!r})\n"
        "    r = t.CliRunner().invoke(scenarionet_pipelines.cli.cli, words); assert r.exit_code == 0, r.output\n"
        "    assert not (found := [name for name in heavy if name in sys.modules]), (words, found)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_loading_one_scenario_imports_no_queries(lake):
    code = (
        f"import sys; from scenarionet_data import ScenarioLoader; ScenarioLoader({str(lake)!r})[0]\n"
        "print(sorted({'duckdb', 'polars', 'pandas', 'shapely', 'dask'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_help_lists_every_verb_with_a_sentence():
    text = run("--help").stdout
    assert len(TOP) <= 17
    for name in (*TOP, *GROUPS):
        assert f"\n  {name} " in text
    for name in GROUPED:
        group, word = name.split()
        assert f"\n  {word} " in run(group, "--help").stdout
    assert [name for name in ALL_VERBS if not find_verb(name).help.split("\n")[0].endswith(".")] == []


@pytest.mark.parametrize("name", ALL_VERBS)
def test_examples_of_every_verb_are_valid(name):
    found = find_verb(name)
    assert found.examples
    for example in found.examples:
        assert f"  {example}\n" in run(*name.split(), "--help").stdout
        program, *words = shlex.split(example)
        typed = [words.pop(0) for _ in name.split()]
        assert (program, *typed) == ("scenarionet", *name.split())
        found.make_context(name, words)  # raises when a word is not understood


@pytest.mark.parametrize("name", ALL_VERBS)
def test_every_option_has_help(name):
    options = [param for param in find_verb(name).params if isinstance(param, click.Option)]
    assert [option.name for option in options if not option.help] == []


def test_every_verb_has_a_json_option():
    assert [name for name in ALL_VERBS if "--json" not in {o for p in find_verb(name).params for o in p.opts}] == []


def test_version():
    assert run("--version").stdout.strip() == version.name_and_version()


# --- errors -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        ("convert wymo {raw} new", 2, "did you mean waymo"),
        ("convert tests.fixtures.made:Made nowhere new", 2, "nowhere: no such folder"),
        ("convert tests.fixtures.made:Made {raw} new --split a/b", 2, "use letters, digits"),
        ("convert tests.fixtures.made:Made {raw} new -p colour=red", 2, "it has max_bad_rows, num_objects"),
        ("convert tests.fixtures.made:Made {raw} new -p num_objects=many", 2, "wants int"),
        ("convert tests.fixtures.made:Made {raw} new -p num_objects", 2, "expects name=value"),
        ("convert tests.fixtures.made:Made {raw} {raw}/a.made --quiet", 1, "choose a folder"),
        ("list nowhere", 1, "no lake there"),
        ("list {lake} --snapshot 7", 1, "no snapshot 7"),
        ("show {lake} nobody", 1, "no one scenario 'nobody'"),
        ("sql {lake} 'SELECT colour FROM metadata'", 2, "colour"),
        ("sql {lake} 'DROP VIEW metadata'", 2, "wanted one SELECT"),
        ("sql {lake} 'SELECT 1 FROM metadata WHER 3'", 2, 'syntax error at or near "3" (character 29)'),
        ("sql {lake} sumary", 2, "did you mean summary"),
        ("sql {lake} summary -p colour=red", 2, "no parameter 'colour'"),
        ("sql {lake} summary -o rows.txt", 2, ".parquet"),
        ("tables files {lake} colours", 2, "no table 'colours'"),
        ("filter {lake} --where 'true; drop' --name x", 2, "wanted one condition"),
        ("filter {lake} --filter ego_distanc --name x", 2, "did you mean ego_distance"),
        ("filter {lake} --filter ego_distance:max=far --name x", 2, "max wants float"),
        ("filter {lake} --name a/b", 2, "is no database name"),
        ("filter {lake} --database nothing --name x", 2, "no database 'nothing'"),
        ("filter {lake} --where 'ego_distanc > 3' --name x", 2, "similar: ego_distance"),
        ("filter {lake} --where 'num_lights > > 3' --name x", 2, "(character 14)"),
        ("filter {lake} --where false --name x", 2, "--allow-empty"),
        ("filter {lake} --id nobody --name x", 1, "ids are not in snapshot 1"),
        ("sample {lake} --name x", 2, "either a number of scenarios or a fraction"),
        ("merge {lake} nothing none --name x", 2, "no database 'nothing'"),
        ("db diff {lake} @1 @9", 1, "no snapshot 9"),
        ("db overlap {lake} one", 2, "two databases or more"),
        ("db lineage {lake} nothing", 2, "no database 'nothing'"),
        ("db drop {lake} nothing@x", 2, "with a number"),
        ("split {lake}", 2, "wanted one of fractions"),
        ("split {lake} --fractions train=0.9", 2, "add up to 1"),
        ("split {lake} --fractions train=most", 2, "expects a number"),
        ("split {lake} --fractions train=0.5 train=0.5", 2, "'train' twice"),
        ("split {lake} --fractions a=0.5 b=0.5 --by colour", 2, "no column 'colour'"),
        ("export {lake} nothing out", 2, "no database 'nothing'"),
        ("info converters nobody", 2, "no converter 'nobody'"),
    ],
)
def test_errors_are_one_line_with_an_exit_code(words, code, says, raw, lake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*shlex.split(words.format(raw=raw, lake=lake)))
    assert result.exit_code == code
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ")
    assert says in line


@pytest.mark.parametrize(
    "words", ["lst lake", "list", "list lake --colour", "split", "convert pg 0:2 lake --workers 0"]
)
def test_unparsable_arguments_are_usage_errors(words):
    result = run(*words.split())
    assert result.exit_code == 2
    assert "Usage: " in result.stderr


def test_similar_verbs_are_suggested():
    assert "did you mean filter" in run("fliter", "lake").stderr
    assert "did you mean maintain fsck" in run("fskc", "lake").stderr


def test_debug_shows_the_traceback():
    result = run("--debug", "list", "nowhere")
    assert result.exception.__class__.__name__ == "NoSuchSnapshot"


def test_the_query_excerpt_is_left_out():
    assert one_line("Parser Error: syntax error\n\nLINE 1: SELEC\n        ^") == "Parser Error: syntax error"


@pytest.mark.long
def test_a_closed_pipe_ends_quietly(lake):
    python = f"{shlex.quote(sys.executable)} -m scenarionet_pipelines.cli"
    command = f"{python} sql {lake} 'SELECT * FROM range(300000)' --csv | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.stdout == "range\n"
    assert "Traceback" not in done.stderr
