"""The fixed-time programme of a scenario's signal, and the log of what its lights showed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int8, Int32

from stylesim.signals import Signals, SignalState
from stylesim.simulation.sumo.options import SignalPlan
from stylesim.simulation.sumo.roads import RoadNetwork, SignalLink

STATES = {"G": SignalState.GREEN, "g": SignalState.GREEN, "y": SignalState.YELLOW, "Y": SignalState.YELLOW}
STATES |= {
    "r": SignalState.RED,
    "s": SignalState.RED,
    "u": SignalState.RED,
    "O": SignalState.DARK,
    "o": SignalState.DARK,
}
SHORTEST_GREEN_S = 5.0  # chosen, because common rules ask for at least 5 s of green


@dataclass(frozen=True)
class Programme:
    """Phases of one signal: (duration in s, state string of its links)."""

    signal: str
    offset_s: float
    phases: tuple[tuple[float, str], ...]

    def xml(self) -> str:
        """The additional file that makes this programme the signal's own."""
        rows = [f'        <phase duration="{duration:.1f}" state="{state}"/>' for duration, state in self.phases]
        head = f'    <tlLogic id="{self.signal}" type="static" programID="episode" offset="{self.offset_s:.1f}">'
        return "\n".join(["<additional>", head, *rows, "    </tlLogic>", "</additional>", ""])


def _letter(link: SignalLink, *, green: bool, plan: SignalPlan) -> str:
    if not green:
        return "r"
    return "g" if link.direction in "lL" and plan.left_turns == "permissive" else "G"


def programme_of(
    plan: SignalPlan, network: RoadNetwork, parameters: Mapping[str, float], *, offset_share: float
) -> Programme:
    """Green, yellow and all-red of each group in turn, from cycle, share of green, yellow and all-red times.

    Times are rounded to 0.1 s (the step); what the changes take off the cycle comes off the greens, each of
    which keeps at least 5 s.
    """
    links = [link for link in network.links if link.signal == plan.junction]
    yellow, all_red = round(parameters["yellow_s"], 1), round(parameters["all_red_s"], 1)
    green = max(parameters["cycle_s"] - 2 * (yellow + all_red), 2 * SHORTEST_GREEN_S)
    first = round(
        float(np.clip(green * parameters["first_green_share"], SHORTEST_GREEN_S, green - SHORTEST_GREEN_S)), 1
    )
    phases: list[tuple[float, str]] = []
    for edges, duration in zip(plan.groups, (first, round(green - first, 1)), strict=True):
        shown = "".join(_letter(link, green=link.edge in edges, plan=plan) for link in links)
        phases.append((duration, shown))
        phases.append((yellow, shown.replace("G", "y").replace("g", "y")))
        if all_red > 0:
            phases.append((all_red, "r" * len(links)))
    cycle = sum(duration for duration, _ in phases)
    return Programme(plan.junction, round(offset_share * cycle, 1), tuple(phases))


def signal_log(
    network: RoadNetwork, shown: Mapping[str, tuple[tuple[str, ...], Int32[np.ndarray, " time"]]]
) -> Signals | None:
    """One light per controlled lane. `shown[signal]` is (distinct state strings, which one per frame)."""
    if not shown:
        return None
    ids, lanes, rows = [], [], []
    for lane in network.controlled_lanes():
        link = next(item for item in network.links if item.lane == lane)
        texts, which = shown[link.signal]
        codes: Int8[np.ndarray, " text"] = np.array(
            [STATES.get(text[link.index], SignalState.UNKNOWN) for text in texts], np.int8
        )
        ids.append(f"{link.signal}:{lane}")
        lanes.append((lane,))
        rows.append(codes[which])
    return Signals(tuple(ids), tuple(lanes), np.stack(rows))
