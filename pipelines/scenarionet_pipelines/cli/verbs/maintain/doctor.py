"""``scenarionet maintain doctor``: check the installation, this machine and a lake."""

from __future__ import annotations

from dataclasses import asdict

from scenarionet_pipelines.cli.output import table
from scenarionet_pipelines.cli.verb import Verb, argument
from scenarionet_pipelines.messages import one_line

_MARKS = {"ok": "ok", "missing": "--", "bad": "BAD"}


class DoctorVerb(Verb):
    """Check the installation, the converters, this machine and, if given, a lake.

    `--` marks an optional part that is missing, `BAD` a problem to fix (exit code 1).
    """

    examples = (
        "scenarionet maintain doctor",
        "scenarionet maintain doctor lake --json",
        "scenarionet maintain doctor s3://bucket/lake",
    )
    lake: str | None = argument()

    def run(self) -> bool:
        from scenarionet_pipelines.doctor import examine

        findings = examine(self.lake)
        num_bad = sum(finding.state == "bad" for finding in findings)
        rows = (
            (_MARKS[f.state], f.topic, f.subject, one_line(f.found) + (f"; {f.remedy}" if f.remedy else ""))
            for f in findings
        )
        self.say({"findings": [asdict(finding) for finding in findings], "is_healthy": not num_bad}, table(rows))
        return not num_bad
