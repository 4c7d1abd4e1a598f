"""`Tracks`: every road user of one scene on one clock."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, IntFlag

import numpy as np
from jaxtyping import Bool, Float, Int

from stylesim.arrays import frozen
from stylesim.style import DriverStyle


class AgentKind(IntEnum):
    """What a road user is. The numbers are part of the on-disk format."""

    OTHER = 0
    CAR = 1
    TRUCK = 2
    BUS = 3
    MOTORCYCLE = 4
    BICYCLE = 5
    PEDESTRIAN = 6
    STATIC = 7


MOTOR_KINDS = (AgentKind.CAR, AgentKind.TRUCK, AgentKind.BUS, AgentKind.MOTORCYCLE)
_MOTOR = np.isin(np.arange(256), [int(k) for k in MOTOR_KINDS])  # by kind


class TrackFlag(IntFlag):
    """What happened to a track. The bits are part of the on-disk format."""

    COLLIDED = 1
    EMERGENCY_BRAKED = 2
    RAN_RED = 4
    TELEPORTED = 8
    REMOVED = 16
    DECIDED_STOP = 32
    DECIDED_GO = 64
    IMPLAUSIBLE = 128
    EGO = 256
    FOCAL = 512
    STOPPED_AT_LINE = 1024
    CROSSED_ON_YELLOW = 2048
    STRESSOR = 4096  # did something unusual because the episode asked for it, or is who walked there
    STRESSED = 8192  # to whom it was done


@dataclass(frozen=True, eq=False)
class Tracks:
    """Every road user of one scene on one clock (frame i is at i * dt_s).

    Positions are of the box centre, in metres from `origin_m` (which is in the source's own frame). Where
    `valid` is False the floats are NaN. `lookahead_steps` is how many frames into the future a value reaches
    (interpolated gaps); 0 where the frame depends on nothing later. `agent_id` is the source's own track id.
    """

    agent_id: tuple[str, ...]
    kind: Int[np.ndarray, " agent"]
    size_m: Float[np.ndarray, "agent 2"]  # length, width
    position_m: Float[np.ndarray, "agent time 2"]
    velocity_mps: Float[np.ndarray, "agent time 2"]
    heading_rad: Float[np.ndarray, "agent time"]  # counter-clockwise from +x
    valid: Bool[np.ndarray, "agent time"]
    dt_s: float
    origin_m: Float[np.ndarray, " 2"] = field(default_factory=lambda: np.zeros(2))
    driver: tuple[DriverStyle | None, ...] = ()
    flags: Int[np.ndarray, " agent"] | None = None
    lookahead_steps: Int[np.ndarray, "agent time"] | None = None

    def __post_init__(self) -> None:
        """Check shapes, give `driver` and `flags` their defaults, make every array read-only."""
        n = len(self.agent_id)
        if len(set(self.agent_id)) != n:
            raise ValueError("agent_id has duplicates within one scene")
        if not self.dt_s > 0:
            raise ValueError(f"dt_s must be positive, not {self.dt_s}")
        frames = np.asarray(self.valid).shape[-1] if np.ndim(self.valid) == 2 else None
        shapes: dict[str, tuple[type, tuple[int | None, ...]]] = {
            "kind": (np.int8, (n,)),
            "size_m": (np.float32, (n, 2)),
            "position_m": (np.float32, (n, frames, 2)),
            "velocity_mps": (np.float32, (n, frames, 2)),
            "heading_rad": (np.float32, (n, frames)),
            "valid": (np.bool_, (n, frames)),
            "origin_m": (np.float64, (2,)),
        }
        if self.flags is None:
            object.__setattr__(self, "flags", np.zeros(n, np.int32))
        shapes["flags"] = (np.int32, (n,))
        if self.lookahead_steps is not None:
            shapes["lookahead_steps"] = (np.int16, (n, frames))
        for name, (dtype, shape) in shapes.items():
            object.__setattr__(self, name, frozen(getattr(self, name), dtype, shape, name))
        drivers = tuple(self.driver) or (None,) * n
        if len(drivers) != n:
            raise ValueError(f"driver has {len(drivers)} entries for {n} agents")
        object.__setattr__(self, "driver", drivers)

    @property
    def n_agents(self) -> int:
        """Number of road users."""
        return len(self.agent_id)

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.valid.shape[1])

    @property
    def speed_mps(self) -> Float[np.ndarray, "agent time"]:
        """Length of the velocity, m/s; NaN where invalid."""
        return np.hypot(self.velocity_mps[..., 0], self.velocity_mps[..., 1])

    @property
    def is_motor(self) -> Bool[np.ndarray, " agent"]:
        """True for cars, trucks, buses and motorcycles."""
        return _MOTOR[self.kind.astype(np.uint8)]

    def flagged(self, flag: TrackFlag) -> Bool[np.ndarray, " agent"]:
        """True for the agents that carry `flag`."""
        assert self.flags is not None
        return (self.flags & int(flag)) != 0

    def frames(self, start: int, stop: int) -> Tracks:
        """The frames [start, stop) of every agent; `origin_m` and the agents stay."""
        if not 0 <= start < stop <= self.n_frames:
            raise ValueError(f"frames [{start}, {stop}) are not within 0..{self.n_frames}")
        cut = slice(start, stop)
        ahead = None if self.lookahead_steps is None else self.lookahead_steps[:, cut]
        return replace(
            self,
            position_m=self.position_m[:, cut],
            velocity_mps=self.velocity_mps[:, cut],
            heading_rad=self.heading_rad[:, cut],
            valid=self.valid[:, cut],
            lookahead_steps=ahead,
        )

    def select(self, keep: Bool[np.ndarray, " agent"]) -> Tracks:
        """The agents where `keep` is True."""
        index = np.flatnonzero(keep)
        assert self.flags is not None
        return replace(
            self,
            agent_id=tuple(self.agent_id[i] for i in index),
            driver=tuple(self.driver[i] for i in index),
            lookahead_steps=None if self.lookahead_steps is None else self.lookahead_steps[index],
            **{
                name: getattr(self, name)[index]
                for name in ("kind", "size_m", "position_m", "velocity_mps", "heading_rad", "valid", "flags")
            },
        )

    def history(self, t0: int, steps: int) -> Tracks:
        """What is known at frame t0: the `steps` frames up to and including t0, nothing that saw a later one.

        Frames whose interpolation reaches across t0 become invalid; a scene that starts later than
        t0 - steps + 1 gives fewer frames. `driver` (the simulator's truth) and `flags` (which know the
        outcome) are removed, so that a forecaster cannot read them.
        """
        cut = self.frames(max(0, t0 - steps + 1), t0 + 1)
        cut = replace(cut, driver=(None,) * self.n_agents, flags=None)
        if cut.lookahead_steps is None:
            return cut
        first = max(0, t0 - steps + 1)
        reach = np.arange(first, t0 + 1)[None, :] + cut.lookahead_steps
        known = cut.valid & (reach <= t0)
        hidden = ~known
        return replace(
            cut,
            valid=known,
            position_m=np.where(hidden[..., None], np.nan, cut.position_m),
            velocity_mps=np.where(hidden[..., None], np.nan, cut.velocity_mps),
            heading_rad=np.where(hidden, np.nan, cut.heading_rad),
            lookahead_steps=None,
        )
