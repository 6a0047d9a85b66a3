"""All errors raised by this project, grouped by remedy.

    ScenarioNetError
      SourceError        the raw data: SourceNotFound, CorruptSource, MissingDependency
      InvalidScenario    one scenario is unusable: quarantined and counted, the run goes on
      LakeError          the lake: FileGone, SchemaMismatch, SnapshotConflict, NoSuchSnapshot,
                         ScenarioNotFound, DuplicateScenario, BrokenContract, DatabaseNotFound,
                         DatabaseExists, DatabaseInUse, LeakingSplit, UserColumnExists,
                         UserColumnNotFound, UserColumnInUse
      WorkerLost         a worker process died; finished work is kept: ClusterLost
      QueryError         user input: UnknownFilter, UnknownQuery, UnknownEvent,
                         UnknownRelation, BadParameter, UnsafeSql, EmptyResult

Messages are one sentence: the finding, followed by a remedy.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class ScenarioNetError(Exception):
    """Base of every error raised on purpose by this project.

    Args:
        *args: The message.
        cli_remedy: Option or command with the same effect as the remedy in the message, which is for Python.
    """

    def __init__(self, *args: object, cli_remedy: str = "") -> None:
        super().__init__(*args)
        self.cli_remedy = cli_remedy


class SourceError(ScenarioNetError):
    """The raw recordings cannot be read as they are."""


class SourceNotFound(SourceError):
    """No raw recording of the dataset at the given path."""


class CorruptSource(SourceError):
    """A raw file is truncated, empty, damaged, or of another format; the shard it belongs to fails alone."""


class MissingDependency(SourceError):
    """An optional package is not installed.

    Args:
        need: What needs which package, for example ``"pictures need matplotlib"``.
        extra: The extra that installs it; empty if nothing does, for this version of Python.
        alternative: Another solution, if there is one.
    """

    def __init__(self, need: str, extra: str, alternative: str = "") -> None:
        super().__init__(need, extra, alternative)  # so that workers can send it

    def __str__(self) -> str:
        need, extra, alternative = self.args
        install = f"pip install 'scenarionet-lake[{extra}]', or in a checkout pip install -e '.[{extra}]'"
        return f"{need}: {'; '.join(filter(None, (install if extra else '', alternative)))}"


@contextmanager
def needing(need: str, extra: str, alternative: str = "") -> Iterator[None]:
    """Raise :class:`MissingDependency`, which see, for a package that the block cannot import."""
    try:
        yield
    except ImportError as error:
        raise MissingDependency(need, extra, alternative) from error


class InvalidScenario(ScenarioNetError):
    """One scenario breaks the contract.

    Args:
        scenario_id: The scenario, or the location of its record if it has no id yet.
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
    """The state of the lake does not allow the operation."""


class SchemaMismatch(LakeError):
    """A file was written with another version of the contract in ``schemas/``."""


class SnapshotConflict(LakeError):
    """Other jobs published snapshots faster than this one; run it again."""


class NoSuchSnapshot(LakeError):
    """The folder is not a lake, or the requested snapshot has expired."""


class FileGone(LakeError, FileNotFoundError):
    """A file of the lake is missing from its object store."""


class ScenarioNotFound(LakeError, KeyError):
    """The snapshot has no scenario of this id."""

    def __str__(self) -> str:
        return str(self.args[0])


class DatabaseNotFound(LakeError, KeyError):
    """The lake has no database of this name."""

    def __str__(self) -> str:
        return str(self.args[0])


class DatabaseExists(LakeError):
    """A database of this name exists, and ``replace`` is False."""


class DatabaseInUse(LakeError):
    """Other databases depend on this one; dropping it would break their lineage."""


class LeakingSplit(LakeError):
    """A split would put scenarios of one source log into several parts."""


class UserColumnNotFound(LakeError, KeyError):
    """The lake has no user column of this name or version."""

    def __str__(self) -> str:
        return str(self.args[0])


class UserColumnInUse(LakeError):
    """Databases depend on this user column; removing it would break their lineage."""


class UserColumnExists(LakeError):
    """A user column of this name exists, and ``replace`` is False."""


class DuplicateScenario(LakeError):
    """The lake already has a scenario of the same id, from another source or with other options."""


class BrokenContract(LakeError):
    """Data to be committed breaks a hard rule of ``sql/checks``."""


class WorkerLost(ScenarioNetError):
    """A worker process was killed; finished work is kept, and the next run continues from there."""


class ClusterLost(WorkerLost):
    """A cluster lost its scheduler or last worker, or cannot be used; finished work is kept."""


class QueryError(ScenarioNetError, ValueError):
    """A query or one of its parameters is invalid or not allowed."""


class UnknownFilter(QueryError):
    """Unknown filter; the message suggests similar names."""


class UnknownQuery(QueryError):
    """Unknown named query; the message suggests similar names."""


class UnknownEvent(QueryError):
    """Unknown event; the message suggests similar names."""


class UnknownRelation(QueryError):
    """Unknown relation; the message suggests similar names."""


class BadParameter(QueryError):
    """A parameter is missing, unknown, of another type, or out of range."""


class UnsafeSql(QueryError):
    """The SQL is not a single read-only statement or expression."""


class EmptyResult(QueryError):
    """A database would have no members, and ``allow_empty`` is False."""
