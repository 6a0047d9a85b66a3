"""Every verb within 1.5 GB of address space; what needs more says so in a sentence."""

from __future__ import annotations

import json
import re
import resource
import shlex
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, Samples, Targets, TimeWindow, convert
from scenarionet_data.forecasts import make_predictions, write_predictions
from scenarionet_data.interchange import WRITERS
from scenarionet_pipelines.cli.address_space import NEEDED
from tests.fixtures.waiting import HANGS_AFTER
from tests.scenarionet_pipelines.test_cli import ALL_VERBS

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit the address space"),
]

COMMANDS = """
convert pg 0:4 lake --workers 2
list lake
show lake 3
sql lake "SELECT count(*) FROM states"
mine lake cut_in
render lake 3 -o picture.png
render lake 3 -o film.gif --size 128 --speed 8
render lake 3 -o street.png --view chase --size 128
report lake -o report.html
filter lake --where "num_objects > 1" --name busy
split lake busy --fractions train=0.5 val=0.5
sample lake busy -n 2 --name few
merge lake busy_train busy_val --name both
vary lake few --name varied -p ego.speed=0.9:1.1 --number 2
sim lake few --policy idm --name idm --workers 2
sim lake few --policy replay --name replay --workers 1 --no-references
export lake few pickles
export lake few commonroad --format commonroad
export lake few gpudrive --format gpudrive
export lake few lanelet2 --format lanelet2
export lake few mcap --format mcap --camera chase --picture-size 64
export lake few maps --format opendrive --workers 2
export lake few openscenario --format openscenario
export lake few pufferdrive --format pufferdrive
export lake few rerun --format rerun
export lake few sumo --format sumo
export lake few waymax --format waymax
export lake few bag1 --format rosbag
export lake few bag2 --format rosbag2
pack lake few packed
db intersect lake busy few --name common
db subtract lake busy few --name others --allow-empty
db diff lake busy few
db overlap lake busy few
db stats lake busy
db lineage lake few
db rebuild lake few
db rebase lake few
db copy lake few some
db rename lake some these
db checkout lake these@1
db drop lake these
db catalogue lake -o catalogue
db tag lake fast --where "ego_max_speed > 5"
db embed lake --name v
db similar lake pg/v2/3 --by v
db overlap lake busy few --embedding v
runs compare lake idm replay
runs verify lake idm --workers 2
runs films lake idm -o films
runs add lake lake --name again
runs search lake cut_in --policy idm --name border -p ego_speed=25 -p lateral_time=4 --most 60 --resolution 0.2
runs regress lake few --policy constant constant --primary route_completion
runs record lake few
tables files lake metadata
tables publish lake --iceberg catalog
maintain check lake --scorecard
maintain check lake few --simulate
maintain fsck lake --deep
maintain compact lake
maintain vacuum lake --keep-last 1 --yes
maintain compile
maintain doctor
info converters pg
info filters
"""
OF_PREDICTIONS = """
forecast score lake predictions.parquet
forecast submit lake predictions.parquet submission.parquet --format argoverse2
"""
OF_TORCH = (
    "train ppo lake few --size small -p steps=64 --name tiny",
    "forecast fit lake few -p epochs=1 -p stride=4 --name tiny_forecaster",
    "traffic learn lake few -p epochs=1 -p min_vehicles=1 -p size=16 --name tiny_traffic",
    "traffic generate lake few --model tiny_traffic --name made --duration 2 --workers 1",
    "traffic measure lake few --model tiny_traffic",
    pytest.param("runs experiment cross-dataset lake -o experiment", marks=pytest.mark.long),
)
TRIED = [
    *COMMANDS.strip().splitlines(),
    *OF_PREDICTIONS.strip().splitlines(),
    "browse",
    "train",
    "forecast fit",
    "traffic learn",
    "traffic generate",
    "traffic measure",
    "runs experiment",
    "runs bridge",
]


def start(folder: Path, words: str, limit: int = NEEDED) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "scenarionet_pipelines.cli", *shlex.split(words)]
    return subprocess.Popen(
        command,
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("small")


@pytest.mark.parametrize("words", [*COMMANDS.strip().splitlines(), *OF_PREDICTIONS.strip().splitlines()])
def test_a_verb_works_in_little_address_space(folder, words):
    if words.startswith("forecast"):
        predict(folder)
    process = start(folder, words)
    out, err = process.communicate(timeout=HANGS_AFTER)
    if "pip install" in err:
        pytest.skip(err)
    assert process.returncode == 0, out[-500:] + err
    assert "memory may not suffice" not in err


def predict(folder):
    """Write constant velocity of the ego as its own prediction."""
    samples = Samples(folder / "lake", window=TimeWindow(history=1.0, future=6.0), targets=Targets("ego"))
    batch = samples.batch([0])
    rows = make_predictions([samples.key(0)], batch["future"][:, :1, :, :2], np.ones((1, 1)), batch["pose"], 0.1)
    write_predictions(folder / "predictions.parquet", [rows])


def test_every_format_is_tried():
    tried = {line.rpartition("--format ")[2].split()[0] for line in TRIED if line.startswith("export")}
    assert WRITERS.keys() <= tried


def test_every_verb_is_tried():
    tried = {name for name in ALL_VERBS if any(f"{line} ".startswith(f"{name} ") for line in TRIED)}
    assert tried == set(ALL_VERBS)


@pytest.mark.learn
@pytest.mark.parametrize("words", OF_TORCH)
def test_a_verb_of_torch_works_in_little_address_space_or_says_what_it_needs(folder, words):
    if not (folder / "lake").exists():  # alone, as by `make test-learn`
        convert("pg", "0:4", folder / "lake")
        Lake(folder / "lake").filter(name="few")
    process = start(folder, words)
    out, err = process.communicate(timeout=4 * HANGS_AFTER)
    assert "Traceback" not in out + err
    says = "torch: pip install" in err or "it needs more memory than is available; use a larger machine" in err
    assert process.returncode == 0 or says, out[-500:] + err


def test_browse_answers_in_little_address_space(folder):
    process = start(folder, "browse lake --port 0")
    assert process.stderr is not None
    assert process.stdout is not None
    address = next(found for line in process.stdout if (found := re.search(r"http://\S+?/", line)))
    with urllib.request.urlopen(address[0] + "api/about", timeout=HANGS_AFTER) as answer:
        assert json.load(answer)["scenarios"] >= 4
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=HANGS_AFTER)
    assert process.returncode == 0


@pytest.mark.parametrize("limit", [300 * 2**20, 500 * 2**20, 700 * 2**20])
@pytest.mark.parametrize(
    "words", ["list lake", 'sql lake "SELECT count(*) FROM states"', "show lake 3", "convert pg 4:6 lake --workers 1"]
)
def test_less_is_a_sentence(folder, words, limit):
    """Whether it suffices depends on versions and processors; last words of a library follow the sentence."""
    process = start(folder, words, limit)
    _, err = process.communicate(timeout=HANGS_AFTER)
    assert err.startswith(f"warning: memory may not suffice: `ulimit -v` allows {limit / 1e9:.1f} GB of address space")
    assert "verbs need 1.6 GB" in err
    assert "Traceback" not in err
