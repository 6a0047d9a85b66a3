"""``scenarionet runs verify``: compute a run again, and compare."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import Distributed, LakeVerb, argument, option

if TYPE_CHECKING:
    from scenarionet_sim.evaluation.receipts import Verification


class VerifyVerb(LakeVerb, Distributed):
    """Compute a run, score or comparison again and compare every value with what was stored, bit by bit.

    RUN is a run of the lake, or a receipt: a JSON file with what the run was made of (policy, seed, scenarios with the
    digests of their content, software) and its rows. --write writes the receipt of a run without simulating, so that
    others can compute the run again in a lake of their own. Receipts of scores and comparisons are written by
    `scenarionet forecast score --receipt` and `scenarionet runs compare --receipt`; a file that was scored is looked
    for beside the receipt, then where it was.

    Exits with 1 if a value differs, and names the first.
    """

    examples = (
        "scenarionet runs verify lake idm_val",
        "scenarionet runs verify lake idm_val --write idm_val.json",
        "scenarionet runs verify their_lake idm_val.json --workers 4",
        "scenarionet runs verify their_lake score.json",
    )
    run_or_receipt: str = argument("RUN|RECEIPT", required=True)
    write: str | None = option("Write the receipt of the run, and do not simulate.", metavar="FILE")

    def run(self) -> bool:
        from scenarionet_sim.evaluation.receipts import Receipt, make_receipt, verify

        if self.write is not None:
            receipt = make_receipt(self.open(), self.run_or_receipt)
            receipt.write(self.write)
            size = {"run": receipt.run, "scenarios": len(receipt.scenarios), "rows": len(receipt.rows)}
            self.say(size, [f"wrote the receipt of {receipt.run} with {count(len(receipt.rows), 'row')}: {self.write}"])
            return True
        path = Path(self.run_or_receipt)
        receipt_or_run = Receipt.read(path) if path.suffix == ".json" else self.run_or_receipt
        with (
            self.execution() as execution,
            self.progress(f"verify {self.run_or_receipt}", "part") as progress,
        ):
            workers, executor = self.num_workers, execution.executor
            if isinstance(receipt_or_run, Receipt) and receipt_or_run.kind != "run":
                from scenarionet_sim.evaluation.score_receipts import verify_score

                found = verify_score(self.open(), receipt_or_run, path.parent, workers=workers, executor=executor)
            else:
                found = verify(
                    self.open(), receipt_or_run, workers=workers, executor=executor, on_progress=progress.update
                )
        self.say(asdict(found), verification_lines(found))
        return found.first is None


def verification_lines(found: Verification) -> Iterator[str]:
    """Yield whether a run came out again, the first value that did not, and the largest differences."""
    if found.first is None:
        yield f"{found.run}: all values of {count(found.rows, 'row')} are equal, bit by bit"
    else:
        yield f"{found.run}: {found.differing:,} of {count(found.rows, 'row')} differ"
        yield f"the first: {found.first}"
    for column, size in sorted(found.largest.items(), key=lambda item: -item[1]):
        yield f"largest difference of {column}: {size:.3g}"
    yield from found.notes
