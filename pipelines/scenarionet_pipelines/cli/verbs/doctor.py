"""``scenarionet doctor``: whether everything is there, and what brings what is not."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.group import one_line, verb
from scenarionet_pipelines.cli.output import print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option

_MARKS = {"ok": "ok", "missing": "--", "bad": "BAD"}


@verb("doctor", "scenarionet doctor", "scenarionet doctor lake --json", "scenarionet doctor s3://bucket/lake")
@click.argument("lake", required=False)
@json_option
def command(lake: str | None, as_json: bool) -> None:
    """Check the installation, the converters, this machine, and a lake when one is given.

    `--` marks what is not there and not needed for everything; `BAD` what has to be mended.
    """
    from scenarionet_pipelines.doctor.local import examine

    findings = examine(lake)
    num_bad = sum(finding.state == "bad" for finding in findings)
    if as_json:
        print_json({"findings": [asdict(finding) for finding in findings], "is_healthy": not num_bad})
    else:
        print_table(
            (_MARKS[f.state], f.topic, f.subject, one_line(f.found) + (f"; {f.remedy}" if f.remedy else ""))
            for f in findings
        )
    click.get_current_context().exit(1 if num_bad else 0)
