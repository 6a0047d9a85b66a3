"""How known drivers fare in logical scenarios and in recorded cut-ins: writes a page with one table for each.

    python docs/examples/driver_results.py lake docs/guides/driver_results.md --recordings waymo=/data/waymo/training

Recordings are converted into the lake, cut-ins are mined in all that it has, and logical scenarios are added to it.
What a lake has already is not made again, nor are runs simulated again.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import click

from scenarionet_data import Lake, convert
from scenarionet_data.errors import DatabaseExists
from scenarionet_data.operations.moments import event
from scenarionet_data.variations import MomentChoice, cut_moments
from scenarionet_sim import evaluate

DRIVERS = {
    "constant": "keeps speed and path",
    "idm": "Intelligent Driver Model on the recorded path",
    "idm-planner": "the same model as a planner along the lanes",
    "lane-graph": "planner of proposals along the lanes",
    "careful-human": "UN R157, annex 4, appendix 3",
    "fuzzy-safety": "UN R157, fuzzy safety model (FSM)",
    "rss": "Responsibility-Sensitive Safety",
}
TOUCHED = """avg((stopped_ego_collisions + stopped_track_collisions + active_rear_collisions + active_front_collisions
    + active_lateral_collisions > 0)::INT)"""  # in the recorded time; collided_vehicles is of the whole episode
MEASURES = f"""
    count(*) AS scenarios, count(error) AS errors, {TOUCHED} AS touched,
    1.96 * sqrt(greatest({TOUCHED} * (1 - {TOUCHED}), 0) / count(*)) AS half,
    avg((at_fault_collisions > 0)::INT) AS at_fault, avg(nuplan_score) AS score,
    median(min_time_to_collision) AS ttc, greatest(-quantile_cont(min_lon_acceleration, 0.1), 0) AS braking
"""


def make_databases(lake: str, recordings: tuple[str, ...], logical: tuple[str, ...], number: int) -> dict[str, str]:
    """Make the scenarios that the lake does not have; return databases by title."""
    for each in recordings:
        dataset, _, raw = each.partition("=")
        report = convert(dataset, raw, lake, split="train")
        click.echo(f"{dataset}: {report.converted} scenarios of {raw}, {report.quarantined} quarantined")
    opened = Lake(lake)
    with suppress(DatabaseExists):
        made = "'pg', 'logical', 'moment', 'variation', 'generated'"
        opened.filter(f"dataset NOT IN ({made})", name="results_searched")
        opened.keep_moments("results_cut_ins", {"cut_in": event("cut_in")}, "results_searched")
        choice = MomentChoice(margin=4.0, order_by="value", limit=number)
        cut_moments(lake, "results_cut_ins", choice, name="results_recorded")
    for name in logical:
        convert("logical", name, lake, options={"number": number})
        with suppress(DatabaseExists):
            Lake(lake).filter(f"parent = 'logical/{name}'", name=f"results_{name}")
    return {
        "results_recorded": "Recorded cut-ins",
        **{f"results_{name}": f"Logical scenario `{name}`" for name in logical},
    }


@click.command()
@click.argument("lake")
@click.argument("page", type=click.Path(path_type=Path))
@click.option("--recordings", multiple=True, metavar="DATASET=RAW", help="Recordings to convert first; repeatable.")
@click.option("--logical", multiple=True, default=("cut_in",), help="Logical scenarios.")
@click.option("--number", default=40, help="Scenarios of each kind.")
def main(lake: str, page: Path, recordings: tuple[str, ...], logical: tuple[str, ...], number: int) -> None:
    """Write the tables below the first line `<!-- results -->` of a page."""
    tables = []
    for database, title in make_databases(lake, recordings, logical, number).items():
        rows = []
        for driver, words in DRIVERS.items():
            run = f"{database}-{driver}"
            evaluate(lake, database, policy=driver, tracker="perfect", name=run, rollouts=False)
            found = Lake(lake).sql(f"SELECT {MEASURES} FROM results WHERE run = '{run}'").row(0, named=True)
            rows.append(
                f"| `{driver}` | {words} | {found['scenarios'] - found['errors']} | {100 * found['touched']:.0f} "
                f"± {100 * found['half']:.0f} | {100 * (found['at_fault'] or 0):.0f} | {found['score']:.3f} "
                f"| {found['ttc']:.2f} | {found['braking']:.1f} |"
            )
            click.echo(rows[-1])
        head = "| driver | | scenarios | touches another [%] | at fault [%] | nuPlan score | TTC [s] | braking [m/s²] |"
        tables.append("\n".join([f"## {title}\n", head, "|---|---|--:|--:|--:|--:|--:|--:|", *rows]))
    before = page.read_text("utf-8").partition("<!-- results -->")[0]
    page.write_text(f"{before}<!-- results -->\n\n" + "\n\n".join(tables) + "\n", "utf-8")


if __name__ == "__main__":
    main()
