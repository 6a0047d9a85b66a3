"""Ids as numbers, for formats in which ids are nothing else."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping

from scenarionet_data.interchange.base import Losses

_END = 2**31


def number_ids(
    groups: Mapping[str, Iterable[str]], losses: Losses, first: int = 0
) -> tuple[dict[str, list[int]], Iterator[int]]:
    """Give every id a number that no other id of any group has: its own, or for other texts the first that is free.

    Args:
        groups: Ids by what they name, in the plural: ``"objects"``.
        losses: Collects the ids that are no numbers, or numbers that an earlier one has.
        first: The smallest number.

    Returns:
        The numbers of each group, and the numbers that are still free.
    """
    listed = {what: list(ids) for what, ids in groups.items()}
    digits = {name for ids in listed.values() for name in ids if name.isascii() and name.isdigit()}
    own = {name for name in digits if str(int(name)) == name and first <= int(name) < _END}
    free = (number for number in range(first, _END) if str(number) not in own)
    taken, numbers = set[str](), dict[str, list[int]]()
    for what, ids in listed.items():
        numbers[what] = []
        for name in ids:
            is_kept = name in own and name not in taken
            numbers[what].append(int(name) if is_kept else next(free))
            if is_kept:
                taken.add(name)
            else:
                reason = "that other elements have" if name in own else "that are no numbers"
                losses.leave_out(f"ids of {what} {reason}")
    return numbers, free


def light_number(lane: str) -> int:
    """Return the number of the traffic light of a lane, above all that ``number_ids`` gives.

    In Lanelet2 maps it is that of the light's rule, and to Autoware that of its group.
    """
    return _END + zlib.crc32(lane.encode())
