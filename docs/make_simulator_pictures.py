"""Draw one scenario by several simulators' own programs: ``python docs/make_simulator_pictures.py``.

Needs the environment of ``make test-interop`` (SUMO, commonroad-io), Xvfb for SUMO's window, and the variables of
Waymax's test, ``SCENARIONET_WAYMAX`` (a checkout) and ``SCENARIONET_WAYMAX_PYTHON``.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import stem_of, write_files
from scenarionet_data.plots import Drawing

TOOLS = Path(__file__).parents[1] / ".venv-interop" / "tools" / "bin"
PICTURE = Path(__file__).parent / "pictures" / "simulators.webp"
SEED, STEP = 9, 90
TILE = 720, 420

SETTINGS = """<viewsettings><scheme name="real world"/><delay value="0"/>
<snapshot file="{picture}" time="{seconds}"/></viewsettings>"""

COMMONROAD = f"""
import sys
import matplotlib; matplotlib.use("Agg")
import matplotlib.pyplot as plt
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.visualization.mp_renderer import MPRenderer
scenario, problems = CommonRoadFileReader(sys.argv[1]).open()
renderer = MPRenderer(figsize=(13, 7.6), plot_limits=[-20, 300, -100, 90])
drawn = renderer.draw_params
drawn.time_begin, drawn.time_end = {STEP}, {STEP + 30}
for part in (drawn, drawn.lanelet_network):  # its icons of lights and signs do not work with NumPy 2
    part.traffic_light.draw_traffic_lights = part.traffic_sign.draw_traffic_signs = False
scenario.draw(renderer)
problems.draw(renderer)
renderer.render()
plt.axis("off")
plt.savefig(sys.argv[2], dpi=100, bbox_inches="tight")
"""

WAYMAX = f"""
import sys
import jax.numpy as jnp, matplotlib.image
from waymax import config, dataloader, visualization
settings = config.DatasetConfig(
    path=sys.argv[1], max_num_rg_points=30_000, include_sdc_paths=True, num_paths=45, num_points_per_path=800, repeat=1
)
state = next(iter(dataloader.simulator_state_generator(settings)))
state = state.replace(timestep=jnp.asarray({STEP}, state.timestep.dtype))
matplotlib.image.imsave(sys.argv[2], visualization.plot_simulator_state(state, use_log_traj=True))
"""


def main() -> None:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        convert("pg", f"{SEED}:{SEED + 1}", work / "lake")
        loader = ScenarioLoader(Lake(work / "lake"))
        stem = work / stem_of(loader.scenario_ids[0])
        Drawing("all", size=1200).save(work / "lake.png", loader[0], now=STEP)
        for name in ("sumo", "commonroad", "waymax"):
            write_files(loader, work / name, writer_for(name))
        (work / "view.xml").write_text(SETTINGS.format(picture=work / "sumo.png", seconds=STEP / 10))
        sumo = [TOOLS / "sumo-gui", "-c", work / "sumo" / f"{stem.name}.sumocfg", "-g", work / "view.xml", "-S", "-Q",
                "--step-length", "0.1", "--end", str(STEP / 10 + 1), "--window-size", "1300,800"]  # fmt: skip
        _run("/usr/bin/xvfb-run", "-a", "-s", "-screen 0 1400x1000x24", *sumo)
        road = work / "commonroad" / f"{stem.name}.xml"
        _run(TOOLS / "python", "-c", COMMONROAD, road, work / "commonroad.png")
        record = work / "waymax" / f"{stem.name}.tfrecord"
        _run(os.environ["SCENARIONET_WAYMAX_PYTHON"], "-c", WAYMAX, record, work / "waymax.png")
        tiles = {"the lake": "lake", "SUMO": "sumo", "CommonRoad": "commonroad", "Waymax": "waymax"}
        _join({title: Image.open(work / f"{name}.png").convert("RGB") for title, name in tiles.items()})


def _run(*words: str | Path) -> None:
    """Run a program that finds Waymax's checkout."""
    subprocess.run(words, check=True, env=os.environ | {"PYTHONPATH": os.environ["SCENARIONET_WAYMAX"]})  # noqa: S603


def _join(tiles: dict[str, Image.Image]) -> None:
    """Write the tiles in two columns, with their titles."""
    width, height = TILE
    joined = Image.new("RGB", (2 * width, (len(tiles) + 1) // 2 * height), "white")
    draw, font = ImageDraw.Draw(joined), ImageFont.load_default(24)
    for number, (title, tile) in enumerate(tiles.items()):
        left, top = number % 2 * width, number // 2 * height
        tile.thumbnail((width - 8, height - 8))
        joined.paste(tile, (left + (width - tile.width) // 2, top + (height - tile.height) // 2))
        draw.text((left + 12, top + 8), title, "black", font, stroke_width=3, stroke_fill="white")
    joined.save(PICTURE, quality=82, method=6)


if __name__ == "__main__":
    main()
