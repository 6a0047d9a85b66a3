"""A URL as an output path: written to, or refused before anything is done; never a folder of that name."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli import main
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["render", "LAKE", "s000001", "-o", "s3://bucket/x.png"], "a picture or video"),
        (["render", "LAKE", "s000001", "-o", "gs://bucket/x.mp4"], "a picture or video"),
        (["show", "LAKE", "s000001", "--picture", "s3://bucket/x.png"], "a picture"),
        (["report", "LAKE", "-o", "s3://bucket/x.html"], "a report"),
        (["db", "stats", "LAKE", "-o", "s3://bucket/x.png"], "a chart"),
        (["sql", "LAKE", "SELECT 1", "-o", "s3://bucket/x.csv"], "a table"),
        (["maintain", "check", "LAKE", "--broken", "s3://bucket/x.csv"], "a table"),
        (["maintain", "check", "LAKE", "--scorecard", "-o", "s3://bucket/x.json"], "a table"),
        (["pack", "LAKE", "busy", "s3://bucket/x.tar", "--tar"], "a tar"),
    ],
)
def test_files_are_not_written_to_a_url(lake, tmp_path, monkeypatch, words, what):
    monkeypatch.chdir(tmp_path)
    result = run(*(str(lake) if word == "LAKE" else word for word in words))
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert f"{what} is written to this machine: give a path, then copy the file to the object store" in result.stderr
    assert not list(tmp_path.glob("[sg][3s]:*"))


def test_paths_made_from_urls_are_refused(lake):
    with pytest.raises(BadParameter, match="a URL that became a path"):
        Lake(Path("s3://bucket/lake"))
    with pytest.raises(BadParameter, match="a URL that became a path"):
        Lake(lake).export(None, Path("s3://bucket/pickles"))


def test_names_that_the_terminal_cannot_show_are_escaped(lake, tmp_path, monkeypatch):
    shown = io.BytesIO()
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(sys, stream, io.TextIOWrapper(shown, "utf-8", "strict", write_through=True))
    monkeypatch.setattr(sys, "argv", ["scenarionet", "list", os.fsdecode(b"/nowhere/caf\xe9")])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert (
        shown.getvalue()
        == b"error: /nowhere/caf\\udce9: the path is not UTF-8; rename the folder, or give another one\n"
    )


@pytest.mark.parametrize("text", [os.fsdecode(b"caf\xe9"), "\ud800"])
def test_sql_that_is_not_utf8_is_refused(lake, text):
    for words in (
        ["sql", lake, f"SELECT '{text}'"],
        ["filter", lake, "--where", f"scenario_id = '{text}'", "--name", "x"],
    ):
        result = run(*words)
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert "wanted SQL as UTF-8 text" in result.stderr


def test_lake_in_a_looping_folder_is_one_sentence(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for words in (["list", tmp_path / "loop"], ["fsck", tmp_path / "loop"], ["doctor", tmp_path / "loop"]):
        result = run(*words)
        assert result.exception is None or isinstance(result.exception, SystemExit)


def test_file_urls_are_paths(lake, tmp_path, ok):
    ok("sql", lake, "SELECT count(*) AS n FROM metadata", "-o", tmp_path.as_uri() + "/x.csv")
    assert (tmp_path / "x.csv").read_text().split() == ["n", "9"]
