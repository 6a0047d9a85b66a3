"""The suite that the test of every writer inherits."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.errors import BadParameter, DatabaseExists
from scenarionet_data.execution.executors import ProcessExecutor
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import INDEX, write_files


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class WriterConformance:
    """What holds for every format; a subclass names it, and the fixture ``lake`` has generated scenarios."""

    name: str

    def contents(self, folder):
        """Files of a folder by name, as far as they are equal for equal scenarios."""
        return contents(folder)

    def export(self, lake, folder, **options):
        return write_files(ScenarioLoader(lake), folder, writer_for(self.name), **options)

    def test_every_scenario_is_written_and_listed(self, lake, tmp_path):
        report = self.export(lake, tmp_path / "out")
        assert report.refused == ()
        assert report.num_scenarios == len(ScenarioLoader(lake))
        assert len((tmp_path / "out" / INDEX).read_text().splitlines()) == report.num_scenarios
        assert not [path for path in tmp_path.iterdir() if path.name != "out"]

    @pytest.mark.integration
    def test_bytes_do_not_depend_on_the_run_or_the_number_of_processes(self, lake, tmp_path):
        self.export(lake, tmp_path / "a")
        self.export(lake, tmp_path / "b", executor=ProcessExecutor(2))
        assert self.contents(tmp_path / "a") == self.contents(tmp_path / "b")

    @pytest.mark.integration
    def test_an_interrupted_export_goes_on(self, lake, tmp_path, monkeypatch):
        monkeypatch.setattr("scenarionet_data.interchange.files._PART", 2)
        done = []

        def stop(count, total, scenarios):
            done.append(count)
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            self.export(lake, tmp_path / "a", on_progress=stop)
        assert not (tmp_path / "a").exists()
        resumed = []
        self.export(lake, tmp_path / "a", on_progress=lambda count, total, scenarios: resumed.append(count))
        assert resumed[0] > done[0]
        self.export(lake, tmp_path / "b")
        assert self.contents(tmp_path / "a") == self.contents(tmp_path / "b")

    @pytest.mark.integration
    def test_nothing_is_overwritten_unasked(self, lake, tmp_path):
        (tmp_path / "own").mkdir()
        (tmp_path / "own" / "notes.txt").write_text("mine")
        with pytest.raises(DatabaseExists, match="something else"):
            self.export(lake, tmp_path / "own", replace=True)
        self.export(lake, tmp_path / "out")
        with pytest.raises(DatabaseExists, match="not empty"):
            self.export(lake, tmp_path / "out")
        self.export(lake, tmp_path / "out", replace=True)

    def test_unknown_options_are_refused(self):
        with pytest.raises(BadParameter, match="no option 'colour'"):
            writer_for(self.name, {"colour": "red"})

    @pytest.mark.integration
    def test_another_database_does_not_take_parts_of_an_interrupted_export(self, lake, tmp_path, monkeypatch):
        monkeypatch.setattr("scenarionet_data.interchange.files._PART", 1)
        ids = ScenarioLoader(lake).scenario_ids

        def stop(count, total, scenarios):
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            write_files(ScenarioLoader(lake, ids[:2]), tmp_path / "a", writer_for(self.name), on_progress=stop)
        write_files(ScenarioLoader(lake, ids[3:]), tmp_path / "a", writer_for(self.name))
        listed = [json.loads(line)["scenario_id"] for line in (tmp_path / "a" / INDEX).read_text().splitlines()]
        assert listed == ids[3:]
