"""The `<begin>_<end>` stamps in the names of DLR's files: 230924-120000_230924-120500, in UTC."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

_PATTERN = re.compile(r"_(\d{6}-\d{6})_(\d{6}-\d{6})\.csv(?:\.gz)?$")


@dataclass(frozen=True)
class Stamp:
    """From when to when a file says that it reaches, in UTC microseconds since 1970."""

    text: str
    begin_us: int
    end_us: int

    @classmethod
    def of(cls, file: Path) -> Stamp | None:
        """The stamp in the file's name; None where it has none that makes sense."""
        match = _PATTERN.search(file.name)
        if match is None:
            return None
        try:
            begin, end = (_microseconds(text) for text in match.groups())
        except ValueError:  # 13th month: a renamed file, not an error
            return None
        return cls("_".join(match.groups()), begin, end) if begin < end else None

    def continues(self, other: Stamp, *, within_s: float) -> bool:
        """True if this file begins where the other one ends, or at most that much later."""
        return 0 <= self.begin_us - other.end_us <= within_s * 1e6


def _microseconds(text: str) -> int:
    time = datetime.strptime(text, "%y%m%d-%H%M%S").replace(tzinfo=UTC)
    return int(time.timestamp()) * 1_000_000
