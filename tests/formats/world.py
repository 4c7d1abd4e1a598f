"""A small world that the tests write in every format: five cars on two lanes, a cyclist, a pedestrian, a crossing."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

ORIGIN = np.array([1200.0, -340.0])
SPEEDS = (10.0, 9.0, 12.0, 0.0, 8.0, 4.0, 1.4)
KINDS = ("car", "car", "car", "car", "car", "cyclist", "pedestrian")
SIZES = ((4.6, 1.9), (4.4, 1.8), (5.1, 2.0), (4.7, 1.9), (4.5, 1.8), (1.8, 0.7), (0.7, 0.7))


@dataclass
class World:
    """[agent, time] arrays in a frame of its own; car 2 is not there before frame `late`."""

    n_frames: int = 91
    dt_s: float = 0.1
    late: int = 5
    id: list[int] = field(default_factory=lambda: [11, 12, 13, 14, 15, 16, 17])

    def __post_init__(self) -> None:
        """Drive along: eastwards in the lanes y = 0 and y = 3.5, the pedestrian northwards."""
        t = np.arange(self.n_frames) * self.dt_s
        n = len(SPEEDS)
        self.kind = list(KINDS)
        self.size = np.array(SIZES)
        speed = np.array(SPEEDS)[:, None] + np.zeros_like(t)
        self.heading = np.zeros((n, self.n_frames))
        start = np.array([[0, 0], [15, 3.5], [-40, 0], [90, 3.5], [-20, 3.5], [20, -3.0], [60, -8.0]], float)
        along = np.array(SPEEDS)[:, None] * t
        # Car 1 brakes gently and sways a little in its lane.
        along[1] = 9.0 * t - 0.25 * t**2
        speed[1] = 9.0 - 0.5 * t
        self.position = np.zeros((n, self.n_frames, 2))
        self.velocity = np.zeros((n, self.n_frames, 2))
        self.position[:, :, 0] = along
        self.velocity[:, :, 0] = speed
        self.position[6], self.velocity[6] = self.position[6][:, ::-1], self.velocity[6][:, ::-1]
        self.heading[6] = np.pi / 2
        self.position += start[:, None] + ORIGIN
        self.valid = np.ones((n, self.n_frames), bool)
        self.valid[2, : self.late] = False

    @property
    def steps(self) -> int:
        """Valid agent-frames."""
        return int(self.valid.sum())


# Two lanes of two pieces each, eastwards; piece b follows a, the right pair is at y = 0, the left one at y = 3.5.
LANES = {
    "21": np.array([[-60.0, 0.0], [0.0, 0.0], [50.0, 0.0]]) + ORIGIN,
    "22": np.array([[50.0, 0.0], [100.0, 0.0], [160.0, 0.0]]) + ORIGIN,
    "23": np.array([[-60.0, 3.5], [0.0, 3.5], [50.0, 3.5]]) + ORIGIN,
    "24": np.array([[50.0, 3.5], [100.0, 3.5], [160.0, 3.5]]) + ORIGIN,
}
SUCCESSORS = {"21": ("22",), "22": (), "23": ("24",), "24": ()}
LEFT = {"21": "23", "22": "24"}
LINES = {
    "31": np.array([[-60.0, -1.75], [160.0, -1.75]]) + ORIGIN,
    "32": np.array([[-60.0, 1.75], [160.0, 1.75]]) + ORIGIN,
    "33": np.array([[-60.0, 5.25], [160.0, 5.25]]) + ORIGIN,
}
CROSSWALK = np.array([[58.0, -6.0], [62.0, -6.0], [62.0, 8.0], [58.0, 8.0]]) + ORIGIN
STOP = np.array([48.0, 0.0]) + ORIGIN
SPEED_LIMIT_MPS = 13.4112  # 30 miles an hour
