"""``scenarionet db catalogue``: what disturbs the egos of a lake, how often, and with which parameters."""

from __future__ import annotations

from scenarionet_pipelines.cli.output import count, print_table
from scenarionet_pipelines.cli.verb import DATABASE, LakeVerb, Progressing, option


class CatalogueVerb(LakeVerb, Progressing):
    """Find the traffic disturbances of ISO 34502 and UN R157, and write them as a catalogue.

    Cut-ins, cut-outs, decelerations ahead and accelerations behind the egos: how often per 1,000 km and hour, with
    exact 95 % intervals of a Poisson process, by dataset, place and road; their parameters; how much of their grid has
    been seen. FOLDER gets a page with pictures and the SQL of every figure, and tables without recordings: ids,
    windows, parameters, definitions. `scenarionet db rebuild LAKE FOLDER` computes it again from the recordings and
    compares. Requires the extra `plots`.
    """

    examples = (
        "scenarionet db catalogue lake -o catalogue",
        "scenarionet db catalogue lake -o town --database town",
    )
    folder: str = option("The folder to write, which must not exist.", "-o", "--output", metavar="FOLDER")
    database: str | None = DATABASE

    def run(self) -> None:
        from scenarionet_data.catalogue import compute_figures, gather_catalogue, write_catalogue
        from scenarionet_pipelines.report import catalogue_page

        lake = self.open()
        with self.progress(f"catalogue {self.folder}") as progress:
            found = gather_catalogue(lake, self.database, progress.update)
        figures = compute_figures(lake, found)
        out = write_catalogue(lake, found, self.folder)
        catalogue_page.write(lake, found, figures, out / "catalogue.html")
        rates = [row for row in figures["rates"].rows if row["dataset"] == "all"]
        if self.as_json:
            self.say({"folder": self.folder, "rates": rates, "left_out": found.left_out}, "")
            return
        rows = []
        for row in rates:
            ends = [(row[unit], row[f"{unit}_low"], row[f"{unit}_high"]) for unit in ("per_1000_km", "per_hour")]
            intervals = [
                "-" if rate is None else f"{rate:,.4g} ({low:,.4g} to {high:,.4g})" for rate, low, high in ends
            ]
            rows.append((row["definition"], row["occurrences"], *intervals))
        print_table(rows, ("disturbance", "occurrences", "per 1,000 km of the egos (95 %)", "per hour (95 %)"))
        scenarios = len(set(found.exposure["scenario_id"].to_pylist()))
        self.say({}, f"{self.folder}: {count(scenarios, 'scenario')}, page {out / 'catalogue.html'}")
