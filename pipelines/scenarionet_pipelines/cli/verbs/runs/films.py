"""``scenarionet runs films``: films of the scenarios in which a run failed."""

from __future__ import annotations

from pathlib import Path

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import LIMIT, ORDER_BY, REPLACE, LakeVerb, Progressing, argument, option


class FilmsVerb(LakeVerb, Progressing):
    """Make a film of each scenario in which a run failed.

    Files are named after the scenarios; of several rollouts the first is filmed. Films that are there already are not
    made again, so the same command goes on after an interruption. Requires the extras `plots` and, for mp4, `video`.
    """

    examples = (
        "scenarionet runs films lake val-idm-replay-kinematic -o films",
        "scenarionet runs films lake idm -o films --where 'crashed' --limit 10 --format gif",
    )
    run_name: str = argument("RUN")
    folder: str = option("Folder of the films.", "-o", "--output", metavar="FOLDER")
    where: str = option("Which scenarios, over results and metadata.", default="success IS NOT TRUE", metavar="SQL")
    order_by: str | None = ORDER_BY
    limit: int | None = LIMIT
    suffix: str = option("Format of the films.", "--format", choices=("mp4", "gif"), default="mp4")
    view: str = option(
        "Follow the ego, frame the route, or show everything.", choices=("ego", "route", "all"), default="ego"
    )
    size: int = option("Length of the longer side [pixel].", type=click.IntRange(64, 8192), default=600)
    replace: bool = REPLACE

    def run(self) -> bool:
        from scenarionet_data import ScenarioLoader, resample
        from scenarionet_data.operations.filter import IN_ORDER, ranked
        from scenarionet_data.plots import Drawing, Scene
        from scenarionet_sim import rollout_moments
        from scenarionet_sim.evaluation.comparison import runs_in_words
        from scenarionet_sim.worlds.world import STEP

        opened = self.open()
        chosen = (
            f"SELECT *, row_number() OVER (ORDER BY scenario_id) AS {IN_ORDER} FROM results JOIN metadata "
            f"USING (scenario_id) WHERE run = $run AND rollout = 0 AND error IS NULL AND ({self.where})"
        )
        query = f"SELECT scenario_id FROM ({chosen}) ORDER BY {ranked(self.order_by, self.limit)}"
        wanted = opened.sql(query, {"run": self.run_name})["scenario_id"].to_list()
        runs = opened.sql("SELECT DISTINCT run FROM results ORDER BY run")["run"].to_list()
        if self.run_name not in runs:
            raise BadParameter(f"no run {self.run_name!r} in this lake; there are: {runs_in_words(runs)}")
        folder = Path(self.folder)
        folder.mkdir(parents=True, exist_ok=True)
        paths = {each: folder / f"{each.replace('/', '_')}.{self.suffix}" for each in wanted}
        missing = [each for each in wanted if self.replace or not paths[each].exists()]
        drawing = Drawing(self.view, size=self.size)
        with self.progress(f"films of {self.run_name}", "film") as progress:
            for number, scenario in enumerate(ScenarioLoader(opened, missing) if missing else (), 1):
                scene = Scene.of(resample(scenario, STEP))
                drawing.save(paths[scenario.id], scene, rollout_moments(opened, self.run_name, scene), 0)
                progress.update(number, len(missing), 0)
        self.say(
            {"run": self.run_name, "films": [str(path) for path in paths.values()], "made": len(missing)},
            f"{self.folder}: {count(len(missing), 'film')} made, {len(wanted) - len(missing)} there already",
        )
        return True
