"""``scenarionet pack``: writing, verifying, and refused arguments."""

from __future__ import annotations

import pytest

from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


@pytest.fixture
def picked(lake, ok):
    ok("filter", lake, "--where", "num_objects > 0", "--name", "picked")
    return lake


def test_packs_and_verifies(picked, ok, as_json, tmp_path):
    said = ok("pack", picked, "picked", tmp_path / "pack")
    assert said.startswith(f"{tmp_path / 'pack'}: picked@1, 9 scenarios, ")
    assert as_json("list", tmp_path / "pack")
    assert ok("pack", "--verify", tmp_path / "pack").endswith(": intact\n")
    packed = as_json("pack", picked, "picked", tmp_path / "p.tar", "--tar")
    assert (packed["reference"], packed["num_scenarios"]) == ("picked@1", 9)
    assert as_json("pack", "--verify", tmp_path / "p.tar") == {
        "path": str(tmp_path / "p.tar"),
        "num_files": packed["num_files"],
        "references": ["picked@1"],
        "damages": [],
        "is_whole": True,
    }


@pytest.mark.long
def test_every_verb_that_reads_opens_a_pack(picked, ok, tmp_path):
    ok("pack", picked, "picked", tmp_path / "pack")
    for words in (
        ("list",), ("check", "picked"), ("sql", "SELECT count(*) FROM states"), ("mine", "cut_in"), ("stats", "picked"),
        ("lineage", "picked"), ("export", "picked", tmp_path / "pickles"), ("files", "tracks"),
    ):  # fmt: skip
        ok(words[0], tmp_path / "pack", *words[1:])


def test_verify_names_broken_files(picked, ok, tmp_path):
    ok("pack", picked, "picked", tmp_path / "pack")
    broken = next((tmp_path / "pack" / "maps").rglob("*.parquet"))
    broken.write_bytes(broken.read_bytes()[:-1])
    result = run("pack", "--verify", tmp_path / "pack")
    assert result.exit_code == 1
    assert broken.relative_to(tmp_path / "pack").as_posix() in result.stdout
    assert result.stdout.endswith("1 file broken\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("pack",), "expected LAKE DATABASE OUT"),
        (("pack", "lake", "picked"), "expected LAKE DATABASE OUT"),
        (("pack", "--verify", "x", "y"), "takes no other arguments"),
        (("pack", "--verify", "nowhere"), "no such pack"),
    ],
)
def test_invalid_arguments(words, message):
    result = run(*words)
    assert result.exit_code == 2
    assert message in result.stderr


def test_rejects_existing_output_and_unknown_database(picked, tmp_path):
    taken = run("pack", picked, "picked", tmp_path)
    assert (taken.exit_code, "choose another name" in taken.stderr) == (2, True)
    unknown = run("pack", picked, "nobody", tmp_path / "pack")
    assert (unknown.exit_code, "no database 'nobody'" in unknown.stderr) == (2, True)
