"""``scenarionet maintain compile``: compile all kernels beforehand."""

from __future__ import annotations

from dataclasses import asdict

from scenarionet_pipelines.cli.output import table
from scenarionet_pipelines.cli.verb import Progressing


class CompileVerb(Progressing):
    """Compile the kernels of loading, conversion and simulation, so that first uses are fast.

    Run it once after an installation, or while building a container image. Kernels that are already cached are not
    compiled again. The cache is in the folder NUMBA_CACHE_DIR if set, else next to the installed packages.
    """

    examples = (
        "scenarionet maintain compile",
        "scenarionet maintain compile --json",
    )

    def run(self) -> None:
        from scenarionet_pipelines.compiling import compile_kernels

        with self.progress("compile", "task") as progress:
            report = compile_kernels(progress.update)
        rows = [(task.task, task.compiled, task.cached, round(task.seconds, 1)) for task in report.tasks]
        lines = table(rows, ("task", "compiled", "cached", "seconds"))
        self.say(asdict(report), lines + [f"cache  {folder}" for folder in report.folders])
