"""Tables of an experiment: every arm against one of them, over all drivers and in one style chosen beforehand."""

from __future__ import annotations

from stylesim.evaluation.intervals import MIN_DRIVERS, MIN_UNITS
from stylesim.evaluation.seeded import SeededEstimate
from stylesim.evaluation.slices import LAST
from stylesim.experiments.results import Experiment


def percent(found: SeededEstimate) -> str:
    """A relative difference and its interval, or why there is none."""
    if found.refused:
        return f"refused: {found.n_drivers} drivers"
    mark = " ws" if found.status == "within site" else ""
    return f"{100 * found.value:+.1f} % [{100 * found.low:+.1f}, {100 * found.high:+.1f}]{mark}"


def metres(found: SeededEstimate) -> str:
    """A mean and its interval."""
    return "refused" if found.refused else f"{found.value:.2f} [{found.low:.2f}, {found.high:.2f}]"


def print_table(
    result: Experiment,
    base: str,
    by: str,
    *,
    least_on_val: tuple[int, int] = (MIN_DRIVERS, 1),
    sites: int | None = None,
) -> str:
    """One row per arm: minFDE, its change against `base` over all drivers and in the worst style, and the worst cell.

    The worst style is the one with the greatest minFDE of `base` on "val", of those with `least_on_val` (drivers,
    units); it is returned. `sites`: how many units there are at most, where the corpus calls smaller things units.
    """
    worst = result.worst(base, by, split="val", least=least_on_val)
    sizes = result.cells(by, split="test")
    shown = [cell for cell, (drivers, _) in sizes.items() if drivers >= MIN_DRIVERS and cell not in LAST]
    drivers, units = sizes.get(worst, (0, 0))
    units = units if sites is None else min(units, sites)
    print(f"\nby {by}: worst on val {worst!r}; on test it has {drivers} drivers of {units} units")
    if drivers < MIN_DRIVERS or units < MIN_UNITS:
        print(f"no claim about {worst!r}: a cell needs {MIN_DRIVERS} drivers and {MIN_UNITS} units")
    print(f"cells of at least {MIN_DRIVERS} drivers on test: " + ", ".join(f"{c} {sizes[c][0]}" for c in shown))
    print("ws: within site, the interval resamples drivers and seeds of fewer than 3 units")
    print(f"{'arm':20}{'seeds':>6}{'drivers':>8}  {'minFDE, m':20}{'all drivers':32}", end="")
    print(f"{worst + ', m':22}{worst:32}worst cell, m")
    for arm in result.arms:
        mean = result.mean(arm)
        change, there = "", ""
        if arm != base:
            change = percent(result.difference(arm, base, relative=True))
            there = (
                percent(result.difference(arm, base, by=by, cell=worst, relative=True)) if drivers else "none on test"
            )
        cells = {cell: result.mean(arm, by=by, cell=cell) for cell in shown}
        most = max(cells, key=lambda cell: cells[cell].value) if cells else ""
        last = f"{most} {metres(cells[most])}" if most else "none of 30 drivers"
        own = metres(result.mean(arm, by=by, cell=worst)) if drivers else "none"
        print(
            f"{arm:20}{mean.n_seeds:6}{mean.n_drivers:8}  {metres(mean):20}{change:32}{own:22}{there:32}{last}",
            flush=True,
        )
    return worst
