"""How the benchmarks print an estimate."""

from __future__ import annotations

from stylesim.evaluation.seeded import SeededEstimate


def estimate_text(value: SeededEstimate, *, scale: float = 1.0, digits: int = 2) -> str:
    """`-1.63 [-2.10, -1.20]`, with the level where it is not 95 %, and a mark where the interval is within one site."""
    if value.refused:
        return f"too few (n = {value.n_drivers})"
    mark = "" if value.level == 0.95 else f" ({value.level:.0%})"
    mark += " †" if value.status == "within site" else ""
    middle, low, high = (scale * number for number in (value.value, value.low, value.high))
    return f"{middle:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]{mark}"
