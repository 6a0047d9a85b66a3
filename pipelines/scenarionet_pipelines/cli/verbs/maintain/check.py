"""``scenarionet maintain check``: check scenarios against the quality rules."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.execution import worker_facts, worker_rows
from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.table_file import check_suffix, write_table
from scenarionet_pipelines.cli.verb import NEW_VERSION, OPTIONAL_DATABASE, SNAPSHOT, Distributed, LakeVerb, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from scenarionet_data import Lake
    from scenarionet_data.execution.executors import Executor
    from scenarionet_data.quality.report import CheckResult
    from scenarionet_data.quality.scorecard import RuleScore, Scorecard

_REPLAYS = "The ego of every recording reaches its destination when replayed."


class CheckVerb(LakeVerb, Distributed):
    """Check the scenarios of a lake, or of a database, against the quality rules.

    The rules are SQL files in sql/checks. Hard rules are structural and also checked during conversion; scenarios
    that violate one cannot be trusted. Soft rules test whether recorded motion is plausible. Real recordings violate
    some of them: each dataset has budgets, and a share of its scenarios may exceed them. Soft rules fail the command
    only with --strict.

    --simulate also replays every recording in the simulator; a scenario whose ego does not reach its destination
    fails. --scorecard reports the violations of each rule by split, and the share of the published scenarios that
    the lake contains. --name saves the scenarios that pass, --broken writes the violations with rule and reason.
    """

    examples = (
        "scenarionet maintain check lake",
        "scenarionet maintain check lake busy --only ids_are_unique --only nobody_teleports",
        "scenarionet maintain check lake --scorecard -o scorecard.csv",
        "scenarionet maintain check lake busy --name good --broken broken.parquet",
        "scenarionet maintain check lake --strict --json",
        "scenarionet maintain check lake busy --simulate --workers 4",
        "scenarionet maintain check lake --scorecard --cluster local",
    )
    database: str | None = OPTIONAL_DATABASE
    only: tuple[str, ...] = option("Run only this check; repeatable.", metavar="NAME")
    strict: bool = option("Treat plausibility rules like structural ones.")
    scorecard: bool = option("Report by dataset, version and split, and compare with published scenario counts.")
    output: str | None = option(
        "Write the scorecard to a .parquet, .csv or .json file.", "-o", "--output", metavar="FILE"
    )
    name: str | None = option(
        "Save the scenarios that pass as a database (with --strict: pass every rule).", metavar="NAME"
    )
    replace: bool = NEW_VERSION
    broken: str | None = option("Write the violations to a .parquet, .csv or .json file.", metavar="FILE")
    simulate: bool = option("Also replay every scenario in the simulator.")
    snapshot: int | None = SNAPSHOT

    def run(self) -> bool:
        from scenarionet_data.quality.checks import run_checks
        from scenarionet_data.quality.passing import save_passing
        from scenarionet_data.quality.scorecard import make_scorecard

        if self.output and not self.scorecard:
            raise BadParameter("-o writes the scorecard: add --scorecard, or use --broken FILE to write the violations")
        for path, spelling in ((self.output, "-o"), (self.broken, "--broken")):
            if path:
                check_suffix(path, spelling)
        opened = self.open()
        with self.execution() as execution:
            with self.progress(f"check {self.lake}", "check") as progress:
                findings = run_checks(
                    opened, self.database, self.only or None, on_progress=progress.update, executor=execution.measured
                )
            if self.simulate:
                findings = findings.with_check("replays", _REPLAYS, self.replay(opened, execution.measured))
        card = make_scorecard(findings) if self.scorecard else None
        made = save_passing(findings, self.name, strict=self.strict, replace=self.replace) if self.name else None
        for rows, path in ((findings.rows, self.broken), (card.rows if card else [], self.output)):
            if path:
                import polars

                write_table(polars.DataFrame(rows), path)
        is_ok = all(result.is_met or not (result.is_hard or self.strict) for result in findings.results)
        content: dict[str, Any] = {"checks": [asdict(result) for result in findings.results]}
        content |= {"scorecard": card.to_dict()} if card else {}
        content |= {"good": {"reference": made.reference} | asdict(made.lineage)} if made else {}
        lines = [*(scorecard_lines(card) if card else result_lines(findings.results))]
        if made:
            total = sum(findings.totals["scenarios"].to_pylist())
            lines.append(f"\n{made.reference}: {len(made):,} of {count(total, 'scenario')}")
        lines += table(worker_rows(execution.stats, "part"))
        self.say(content | {"is_ok": is_ok} | worker_facts(execution.stats), lines)
        return is_ok

    def replay(self, lake: Lake, executor: Executor | None) -> list[tuple[str, str]]:
        """Return the scenarios whose ego does not reach its destination when it is replayed, with details."""
        from scenarionet_sim.evaluation.evaluation import find_broken

        with self.progress("simulate", "part") as progress:
            return find_broken(
                lake, self.database, workers=self.num_workers, executor=executor, on_progress=progress.update
            )


def verdict(mark: CheckResult | RuleScore) -> str:
    """Return a word for the result of a check."""
    if mark.is_met:
        return "ok"
    return "FAILED" if mark.is_hard else "doubtful"


def result_lines(results: Sequence[CheckResult]) -> Iterator[str]:
    """Yield the verdict of each check, then examples of what breaks it."""
    yield from table((verdict(result), result.name, result.doc) for result in results)
    for result in results:
        if not result.examples:
            continue
        broken = [count(result.num_scenarios, "scenario")] if result.num_scenarios else []
        broken += [count(result.num_others, "map or shard").replace("shards", "shard")] if result.num_others else []
        within = ", within the budget" if result.is_met else ""
        yield f"\n{result.name}: {' and '.join(broken)}{within}, for example"
        yield from table(("", scenario_id or "-", detail) for scenario_id, detail in result.examples)


def scorecard_lines(card: Scorecard) -> Iterator[str]:
    """Yield what each split holds, and how many of its scenarios break each rule."""
    for number, split in enumerate(card.partitions):
        yield ("\n" if number else "") + "/".join((split.dataset, split.version, split.split))
        coverage = split.coverage
        published = f"{coverage.text} ({coverage.release.source})" if coverage else "no published counts for this split"
        budgets = ", ".join(f"{name} {value:g}" for name, value in asdict(split.budgets).items())
        holds = f"{count(split.scenarios, 'scenario')}, {split.quarantined:,} in quarantine"
        yield from table([("", "holds", holds), ("", "split", published), ("", "budgets", budgets)])
        rows = []
        for mark in split.rules:
            example = one_line(": ".join(mark.examples[0])) if mark.examples else ""
            rows.append(("", verdict(mark), mark.check, mark.broken, f"{mark.share:.2%}", example))
        yield from table(rows)
    yield from (f"\n{check}: {detail}" for check, detail in card.others)
