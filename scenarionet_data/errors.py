"""Every error this project raises, grouped by what the caller can do about it.

    ScenarioNetError
      SourceError        the raw data: SourceNotFound, CorruptSource, MissingDependency
      InvalidScenario    one scenario is unusable: quarantined and counted, the run goes on
      LakeError          the lake: FileGone, SchemaMismatch, SnapshotConflict, NoSuchSnapshot,
                         ScenarioNotFound, DuplicateScenario, BrokenContract, DatabaseNotFound,
                         DatabaseExists, DatabaseInUse, LeakingSplit, LayerExists, LayerNotFound,
                         LayerInUse
      WorkerLost         a worker process died; what it had finished is kept: ClusterLost
      QueryError         the user's words: UnknownFilter, UnknownQuery, UnknownEvent,
                         BadParameter, UnsafeSql, EmptyResult

Messages are one sentence that says what was found, followed by what to do next.
"""

from __future__ import annotations


class ScenarioNetError(Exception):
    """Base of every error raised on purpose by this project."""


class SourceError(ScenarioNetError):
    """The raw recordings cannot be read as they are."""


class SourceNotFound(SourceError):
    """No raw recording of the wanted dataset at the given place."""


class CorruptSource(SourceError):
    """A raw file is truncated, empty, damaged, or of another format; the shard it belongs to fails alone."""


class MissingDependency(SourceError):
    """A package that only this operation needs is not installed; the message names the extra."""


class InvalidScenario(ScenarioNetError):
    """One scenario breaks the contract.

    Args:
        scenario_id: The scenario, or where its record stands when it has no id yet.
        field: The offending field, for example ``"tracks.position"``.
        reason: What was wanted and what was found.
    """

    def __init__(self, scenario_id: str, field: str, reason: str) -> None:
        super().__init__(scenario_id, field, reason)
        self.scenario_id = scenario_id
        self.field = field
        self.reason = reason

    def __str__(self) -> str:
        return f"{self.scenario_id}: {self.field}: {self.reason}"


class LakeError(ScenarioNetError):
    """The lake on disk does not allow the operation."""


class SchemaMismatch(LakeError):
    """A file was written under another version of the contract in ``schemas/``."""


class SnapshotConflict(LakeError):
    """Another job kept publishing snapshots faster than this one could; run the command again."""


class NoSuchSnapshot(LakeError):
    """The folder is not a lake, or the wanted snapshot has expired."""


class FileGone(LakeError, FileNotFoundError):
    """A file of the lake is not in its object store."""


class ScenarioNotFound(LakeError, KeyError):
    """No scenario of that id in this snapshot."""

    def __str__(self) -> str:
        return str(self.args[0])


class DatabaseNotFound(LakeError, KeyError):
    """No database of that name in this lake."""

    def __str__(self) -> str:
        return str(self.args[0])


class DatabaseExists(LakeError):
    """A database of that name exists and replacing it was not asked for."""


class DatabaseInUse(LakeError):
    """Other databases were made from this one: without it, nobody could say how."""


class LeakingSplit(LakeError):
    """Scenarios of one source log would stand in several parts of a split."""


class LayerNotFound(LakeError, KeyError):
    """No layer of that name, or no such version of it."""

    def __str__(self) -> str:
        return str(self.args[0])


class LayerInUse(LakeError):
    """Queries of databases asked this layer: without it, they could not be made again."""


class LayerExists(LakeError):
    """A layer of that name exists and replacing it was not asked for."""


class DuplicateScenario(LakeError):
    """A scenario of the same id is in the lake already, converted from another source or with other options."""


class BrokenContract(LakeError):
    """What was about to be committed breaks a hard rule of ``sql/checks``."""


class WorkerLost(ScenarioNetError):
    """A worker process was killed; what had been finished is kept, and the next run goes on from there."""


class ClusterLost(WorkerLost):
    """A cluster's scheduler or its last worker is gone, or they cannot be used; what had been finished is kept."""


class QueryError(ScenarioNetError, ValueError):
    """The words of a query cannot be understood or are not allowed."""


class UnknownFilter(QueryError):
    """No filter of that name; the message lists the nearest."""


class UnknownQuery(QueryError):
    """No question of that name; the message lists the nearest."""


class UnknownEvent(QueryError):
    """No event of that name; the message lists the nearest."""


class BadParameter(QueryError):
    """A parameter is missing, unknown, or has a value outside its range."""


class UnsafeSql(QueryError):
    """The SQL is not a single reading statement or expression."""


class EmptyResult(QueryError):
    """No scenario is left, and a database without members was not asked for."""
