"""fsck of scenarios whose metadata has no seal: their content hash tells whether a value has changed."""

from __future__ import annotations

from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.maintenance.findings import Findings
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.file_checks import Damage
from scenarionet_data.storage.snapshots.snapshot import Snapshot


def check(files: LakeFiles, newest: Snapshot, found: Findings) -> None:
    """Compare content hashes of the newest snapshot's scenarios if its metadata cannot be verified otherwise.

    Names of a split, a raw file or a licence are not part of the hash.

    Args:
        files: The lake.
        newest: Its newest snapshot.
        found: What has been found so far; nothing is compared if anything is damaged.
    """
    older = [name for name in newest.metadata if name in found.older and not files.are_verified([name])]
    if not older or found.damages:
        return
    written: dict[str, tuple[str, int]] = {}
    for name in older:
        rows = files.read(name, ["scenario_id", "content_hash"])
        pairs = zip(rows["scenario_id"].to_pylist(), rows["content_hash"].to_pylist(), strict=True)
        written |= {scenario_id: (name, digest) for scenario_id, digest in pairs}
    loader = ScenarioLoader(str(files.root))
    for position, scenario_id in enumerate(loader.scenario_ids):
        if scenario_id in written:
            name, digest = written[scenario_id]
            with found.of(name):
                if content_hash(loader[position]) != digest:
                    found.damages.append(Damage(name, f"the content of {scenario_id} differs from what was written"))
