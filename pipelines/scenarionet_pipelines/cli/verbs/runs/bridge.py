"""``scenarionet runs bridge``: let a driving stack in another process drive."""

from __future__ import annotations

from scenarionet_pipelines.cli.output import count, duration
from scenarionet_pipelines.cli.verb import Progressing, argument, option
from scenarionet_pipelines.messages import one_line


class BridgeVerb(Progressing):
    """Let a driving stack in another process drive a scenario, a database, or the whole lake.

    STACK is ros2, ros1, autoware or openpilot. The stack's run is a run of the lake, as of `scenarionet sim --policy
    ros2:dds`, which this is a shorter way to say. Start the stack before or after; in docs/guides, stacks.md,
    autoware.md and openpilot.md list what it gets and answers.

    Exits with 1 if a scenario could not be driven to its end, and says why.
    """

    examples = (
        "scenarionet runs bridge ros2 lake busy_val",
        "scenarionet runs bridge ros2 lake nuscenes/v1.0-mini/scene-0061 --realtime --with camera --with lidar",
        "scenarionet runs bridge ros2 lake busy_val --wire zenoh --name stack",
        "scenarionet runs bridge autoware lake nuscenes/v1.0-mini/scene-0061 --realtime",
        "scenarionet runs bridge openpilot lake nuscenes/v1.0-mini/scene-0061 --realtime",
    )
    stack: str = argument("STACK")
    lake: str = argument()
    scenario_or_database: str | None = argument("[SCENARIO|DATABASE]")
    wire: str | None = option("What carries messages of ROS 2. [default: dds]", choices=("dds", "zenoh"))
    realtime: bool = option(
        "Keep to the wall clock, or wait for each answer. [default: lockstep]", "--realtime/--lockstep"
    )
    topics: tuple[str, ...] = option(
        "Send this, too: camera, compressed, lidar, scan, markers or map; repeatable.", "--with", metavar="NAME"
    )
    traffic: str = option("Policy of the others, as of `scenarionet sim`.", default="replay", metavar="NAME")
    name: str | None = option("Name of the run.", metavar="NAME")

    def run(self) -> bool:
        from scenarionet_sim.bridges.stacks import REALTIME, Stack, link
        from scenarionet_sim.evaluation.evaluation import evaluate

        wire = self.wire or {"ros1": "tcp", "openpilot": "msgq"}.get(self.stack, "dds")
        policy = "+".join((f"{self.stack}:{wire}", *self.topics, *([REALTIME] if self.realtime else [])))
        stack, wanted = Stack.parse(policy), self.scenario_or_database
        with self.progress(f"bridge {policy}") as progress:
            report = evaluate(
                self.lake,
                (wanted,) if wanted and "/" in wanted else wanted,
                policy=policy,
                name=self.name,
                traffic=self.traffic,
                on_progress=progress.update,
            )
        late = link(stack).num_late if self.realtime and report.skipped < report.scenarios else 0
        broken = [{"scenario_id": scenario_id, "reason": reason} for scenario_id, reason in report.broken]
        done = {"run": report.run, "scenarios": report.scenarios, "skipped": report.skipped, "late": late}
        lines = [f"run {report.run}: {count(report.scenarios, 'scenario')}, took {duration(report.seconds)}"]
        lines += [f"{late:,} timesteps were late: this machine was slower than the clock"] if late else []
        self.say(done | {"seconds": report.seconds, "broken": broken}, lines)
        self.complain(f"could not be driven to its end: {each}: {one_line(reason)}" for each, reason in report.broken)
        return not report.broken
