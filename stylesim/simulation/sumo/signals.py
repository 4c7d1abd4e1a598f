"""The fixed-time programmes of a scenario's signals, and the log of what its lights showed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int8, Int32

from stylesim.errors import InputError
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
ONSET_S = 0.15  # nobody reacts to a yellow younger than this: decisions come between its first and its second step
SHORTEST_GREEN_S = 5.0  # chosen, because common rules ask for at least 5 s of green


@dataclass(frozen=True)
class Programme:
    """Phases of one signal: (duration in s, state string of its links)."""

    signal: str
    offset_s: float
    phases: tuple[tuple[float, str], ...]

    def yellow_onsets_s(self, link: int, until_s: float) -> list[float]:
        """When that link turns from green to yellow, up to `until_s` on SUMO's clock."""
        cycle = sum(duration for duration, _ in self.phases)
        times: list[float] = []
        at = self.offset_s % cycle - cycle
        while at < until_s:
            for number, (duration, state) in enumerate(self.phases):
                if state[link] == "y" and self.phases[number - 1][1][link] in "Gg" and 0.0 <= at < until_s:
                    times.append(round(at, 1))
                at += duration
        return times

    def xml(self) -> str:
        """The element that makes this programme the signal's own."""
        rows = [f'        <phase duration="{duration:.1f}" state="{state}"/>' for duration, state in self.phases]
        head = f'    <tlLogic id="{self.signal}" type="static" programID="episode" offset="{self.offset_s:.1f}">'
        return "\n".join([head, *rows, "    </tlLogic>"])


def programmes_xml(programmes: Sequence[Programme]) -> str:
    """The additional file of an episode's programmes."""
    return "\n".join(["<additional>", *(programme.xml() for programme in programmes), "</additional>", ""])


def _letter(link: SignalLink, group: tuple[str, ...], plan: SignalPlan) -> str:
    """What a link shows while a group has green: G, g (must yield to oncoming traffic) or r."""
    for movement in group:
        edge, _, directions = movement.partition(":")
        if edge == link.edge and (not directions or link.direction in directions):
            yields = not directions and link.direction in "lL" and plan.left_turns == "permissive"
            return "g" if yields else "G"
    return "r"


def _greens(plan: SignalPlan, parameters: Mapping[str, float], lost_s: float) -> list[float]:
    """How long each group has green, in s, on the grid of 0.1 s; at least 5 s each."""
    n = len(plan.groups)
    green = max(parameters["cycle_s"] - lost_s, n * SHORTEST_GREEN_S)
    longest = green - (n - 1) * SHORTEST_GREEN_S
    first = round(float(np.clip(green * parameters["first_green_share"], SHORTEST_GREEN_S, longest)), 1)
    weights = np.array(plan.weights or [1.0] * (n - 1))
    spare = green - first - (n - 1) * SHORTEST_GREEN_S
    ends = np.cumsum(SHORTEST_GREEN_S + spare * weights / weights.sum()).round(1)
    return [first, *(round(float(value), 1) for value in np.diff(ends, prepend=0.0))]


def programme_of(
    plan: SignalPlan, network: RoadNetwork, parameters: Mapping[str, float], *, offset_share: float
) -> Programme:
    """Green, yellow and all-red of each group in turn, from cycle, share of green, yellow and all-red times.

    Times are rounded to 0.1 s (the step); what the changes take off the cycle comes off the greens, each of
    which keeps at least 5 s. What has green in the next group, too, keeps it in between. Programmes of one episode
    share their `offset_share` of the cycle; each begins `wave_m` / speed limit and `wave_cycles` later than that.
    InputError if a movement is none of the junction's.
    """
    links = [link for link in network.links if link.signal == plan.junction]
    _check_movements(plan, links)
    yellow, all_red = round(parameters["yellow_s"], 1), round(parameters["all_red_s"], 1)
    shown = [[_letter(link, group, plan) for link in links] for group in plan.groups]
    phases: list[tuple[float, str]] = []
    for index, duration in enumerate(_greens(plan, parameters, len(plan.groups) * (yellow + all_red))):
        now, after = shown[index], shown[(index + 1) % len(shown)]
        ends = [a in "Gg" and b == "r" for a, b in zip(now, after, strict=True)]
        phases.append((duration, "".join(now)))
        phases.append((yellow, "".join("y" if end else a for a, end in zip(now, ends, strict=True))))
        if all_red > 0:
            phases.append((all_red, "".join("r" if end else a for a, end in zip(now, ends, strict=True))))
    cycle = sum(duration for duration, _ in phases)
    delay = plan.wave_m / parameters["speed_limit_mps"] + plan.wave_cycles * cycle
    return Programme(plan.junction, round((offset_share * cycle + delay) % cycle, 1), tuple(phases))


def _check_movements(plan: SignalPlan, links: Sequence[SignalLink]) -> None:
    known = sorted({link.edge for link in links})
    if not links:
        raise InputError(f"signal {plan.junction!r}: the network has no traffic light of that name")
    for movement in (item for group in plan.groups for item in group):
        edge, _, directions = movement.partition(":")
        if not any(link.edge == edge and (not directions or link.direction in directions) for link in links):
            raise InputError(
                f"signal {plan.junction!r}: no movement {movement!r}; the edges that it controls: {', '.join(known)}"
            )


def main_link(links: Sequence[SignalLink]) -> SignalLink:
    """The link that stands for a lane: its straight movement's if it has one."""
    return min(links, key=lambda link: (link.direction != "s", link.index))


def signal_log(
    network: RoadNetwork, shown: Mapping[str, tuple[tuple[str, ...], Int32[np.ndarray, " time"]]]
) -> Signals | None:
    """One light per controlled lane. `shown[signal]` is (distinct state strings, which one per frame)."""
    if not shown:
        return None
    ids, lanes, rows = [], [], []
    for lane in network.controlled_lanes():
        link = main_link([item for item in network.links if item.lane == lane])
        texts, which = shown[link.signal]
        codes: Int8[np.ndarray, " text"] = np.array(
            [STATES.get(text[link.index], SignalState.UNKNOWN) for text in texts], np.int8
        )
        ids.append(f"{link.signal}:{lane}")
        lanes.append((lane,))
        rows.append(codes[which])
    return Signals(tuple(ids), tuple(lanes), np.stack(rows))
