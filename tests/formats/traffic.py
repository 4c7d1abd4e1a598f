"""Road users on a made-up crossing, from which the tests write files in each format."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stylesim.tracks import AgentKind

LANE_Y = (0.0, 3.5)  # two lanes that go east
SOUTH_X = 40.0  # a lane that goes south and crosses them


@dataclass(frozen=True)
class Row:
    """One road user in one frame: metres, radians, box centre."""

    agent: int
    frame: int
    t: float
    x: float
    y: float
    vx: float
    vy: float
    heading: float
    length: float
    width: float
    kind: AgentKind


def rows(*, n_frames: int = 120, dt_s: float = 0.1, n_cars: int = 5) -> list[Row]:
    """Cars with gently changing speed on two lanes, a lorry that goes south, a person who walks north."""
    found = []
    for agent in range(1, n_cars + 1):
        phase = 0.7 * agent
        for frame in range(n_frames):
            t = frame * dt_s
            # The integral of 9 + 1.5 sin(0.5 t + phase).
            x = 9 * t - 3 * (np.cos(0.5 * t + phase) - np.cos(phase)) - 15.0 * agent
            v = 9 + 1.5 * np.sin(0.5 * t + phase)
            y = LANE_Y[agent % 2] + 0.2 * np.sin(0.3 * t + phase)
            vy = 0.06 * np.cos(0.3 * t + phase)
            found.append(
                Row(agent, frame, t, x, y, v, vy, float(np.arctan2(vy, v)), 4.2 + 0.1 * agent, 1.8, AgentKind.CAR)
            )
    for frame in range(n_frames // 3, n_frames):
        t = frame * dt_s
        found.append(Row(n_cars + 1, frame, t, SOUTH_X, 60 - 6 * t, 0.0, -6.0, -np.pi / 2, 9.0, 2.5, AgentKind.TRUCK))
        found.append(
            Row(n_cars + 2, frame, t, 50.0, -20 + 1.2 * t, 0.0, 1.2, np.pi / 2, 0.6, 0.6, AgentKind.PEDESTRIAN)
        )
    return found


def text(header: str, lines: list[tuple[object, ...]], *, separator: str = ",") -> str:
    """A table of text; numbers are written with up to six decimals."""
    body = [separator.join(_field(value) for value in line) for line in lines]
    return "\n".join([header, *body, ""] if header else [*body, ""])


def _field(value: object) -> str:
    return f"{value:.6f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)
