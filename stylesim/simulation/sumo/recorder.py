"""Logs an episode in memory while it runs: two getter calls per vehicle and step, everything else per step.

docs/logging.md says what was measured and why it is done this way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
from jaxtyping import Float64, Int32

from stylesim.simulation.sumo.engine import SumoApi

EXTRA = "/"  # how the ids of vehicles begin that are no drivers: obstacles, which nobody logs
FLUSH_STEPS = 400  # Python tuples of so many steps are held at most, to bound memory


@dataclass(frozen=True, eq=False)
class SignalTexts:
    """What one signal showed: the distinct state strings, and which one in every step."""

    texts: tuple[str, ...]
    shown: Int32[np.ndarray, " step"]


@dataclass(frozen=True, eq=False)
class RawLog:
    """What SUMO said, row by row in order of step: the front bumper in SUMO's frame, metres.

    `driver` and `step` say whose row it is and of which simulation step; `lateral_m` is the offset from the centre
    of its lane (left positive, it jumps where SUMO changes the lane's name). Events are (step, driver number).
    """

    driver_ids: tuple[str, ...]
    depart_step: Int32[np.ndarray, " driver"]
    first_heading_rad: Float64[np.ndarray, " driver"]  # in its first row; for who never moves
    driver: Int32[np.ndarray, " row"]
    step: Int32[np.ndarray, " row"]
    front_m: Float64[np.ndarray, "row 2"]
    lateral_m: Float64[np.ndarray, " row"]
    signals: Mapping[str, SignalTexts]
    collisions: tuple[tuple[int, str, str], ...]
    emergency_stops: tuple[tuple[int, str], ...]
    teleports: tuple[tuple[int, str], ...]
    removed: tuple[tuple[int, str], ...]
    missed_turns: tuple[tuple[int, str], ...] = ()


@dataclass
class _Events:
    collisions: list[tuple[int, str, str]] = field(default_factory=list)
    emergency_stops: list[tuple[int, str]] = field(default_factory=list)
    teleports: list[tuple[int, str]] = field(default_factory=list)
    removed: list[tuple[int, str]] = field(default_factory=list)


class Recorder:
    """Call `after_step` after every step of an episode; rows are kept from `first_step` on."""

    def __init__(self, sumo: SumoApi, *, signals: Sequence[str], first_step: int) -> None:
        self._sumo, self._first = sumo, first_step
        self._number: dict[str, int] = {}
        self._depart: list[int] = []
        self._here: dict[str, int] = {}
        self._unseen: list[str] = []
        self._angle_deg: dict[str, float] = {}
        self._ids: list[str] = []
        self._numbers = np.zeros(0, np.int32)
        self._rows: list[tuple[int, np.ndarray]] = []  # (step, the driver numbers of its rows)
        self._fronts: list[Sequence[tuple[float, float]]] = []
        self._laterals: list[list[float]] = []
        self._blocks: list[tuple[np.ndarray, np.ndarray]] = []
        self._texts: dict[str, dict[str, int]] = {name: {} for name in signals}
        self._shown: dict[str, list[int]] = {name: [] for name in signals}
        self._events = _Events()

    def take_in(self, names: Sequence[str], step: int) -> None:
        """Vehicles that were on the road before the first step that is recorded, as if they had departed in `step`."""
        for name in names:
            self._number[name] = len(self._depart)
            self._depart.append(step)
            self._here[name] = self._number[name]
        self._unseen.extend(names)

    def take_out(self, name: str) -> None:
        """A driver was taken off the road on purpose: its log ends, and that is no event."""
        self._here.pop(name, None)
        self._list_anew()

    def _list_anew(self) -> None:
        self._ids = list(self._here)
        self._numbers = np.fromiter(self._here.values(), np.int32, len(self._here))

    def after_step(self, step: int) -> None:
        """Takes what the step brought."""
        self._follow_traffic(step)
        self._follow_events(step)
        for name, texts in self._texts.items():
            text = self._sumo.trafficlight.getRedYellowGreenState(name)
            self._shown[name].append(texts.setdefault(text, len(texts)))
        if step < self._first or not self._ids:
            return
        vehicle = self._sumo.vehicle
        if self._unseen:
            self._angle_deg |= {name: vehicle.getAngle(name) for name in self._unseen if name in self._here}
            self._unseen = []
        self._rows.append((step, self._numbers))
        self._fronts.append(list(map(vehicle.getPosition, self._ids)))
        self._laterals.append(list(map(vehicle.getLateralLanePosition, self._ids)))
        if len(self._fronts) >= FLUSH_STEPS:
            self._flush()

    def _follow_traffic(self, step: int) -> None:
        """Keeps the list of vehicles on the road; only steps with entries or exits cost more than three calls."""
        departed = [name for name in self._sumo.simulation.getDepartedIDList() if not name.startswith(EXTRA)]
        arrived = self._sumo.simulation.getArrivedIDList()
        self.take_in(departed, step)
        for name in arrived:
            self._here.pop(name, None)
        gone = self._sumo.vehicle.getIDCount() != len(self._here)
        if gone:
            self._resynchronise(step)
        if departed or arrived or gone:
            self._list_anew()

    def _resynchronise(self, step: int) -> None:
        """Vehicles that vanished without arriving, or came without departing (after a teleport)."""
        present = set(self._sumo.vehicle.getIDList())
        for name in [name for name in self._here if name not in present]:
            del self._here[name]
            self._events.removed.append((step, name))
        for name in sorted(present - set(self._here)):
            if name in self._number:
                self._here[name] = self._number[name]

    def _follow_events(self, step: int) -> None:
        simulation, events = self._sumo.simulation, self._events
        for collision in simulation.getCollisions():
            if collision.collider.startswith(EXTRA) or collision.victim.startswith(EXTRA):
                continue  # whoever really touches a walker is found on the boxes
            events.collisions.append((step, collision.collider, collision.victim))
        events.emergency_stops.extend((step, name) for name in simulation.getEmergencyStoppingVehiclesIDList())
        events.teleports.extend((step, name) for name in simulation.getStartingTeleportIDList())

    def _flush(self) -> None:
        n = sum(len(lateral) for lateral in self._laterals)
        flat = chain.from_iterable(chain.from_iterable(self._fronts))
        fronts = np.fromiter(flat, np.float64, 2 * n).reshape(n, 2)
        self._blocks.append((fronts, np.fromiter(chain.from_iterable(self._laterals), np.float64, n)))
        self._fronts, self._laterals = [], []

    def finish(self) -> RawLog:
        """The log of all steps taken so far."""
        self._flush()
        counts = [len(numbers) for _, numbers in self._rows]
        none = np.zeros(0, np.int32)
        compass = np.array([self._angle_deg.get(name, 90.0) for name in self._number], np.float64)
        return RawLog(
            driver_ids=tuple(self._number),
            depart_step=np.array(self._depart, np.int32),
            first_heading_rad=np.radians(90.0 - compass),  # SUMO: degrees, clockwise from north
            driver=np.concatenate([numbers for _, numbers in self._rows] or [none]),
            step=np.repeat(np.array([step for step, _ in self._rows], np.int32), counts),
            front_m=np.concatenate([front for front, _ in self._blocks]),
            lateral_m=np.concatenate([lateral for _, lateral in self._blocks]),
            signals={
                name: SignalTexts(tuple(texts), np.array(self._shown[name], np.int32))
                for name, texts in self._texts.items()
            },
            collisions=tuple(self._events.collisions),
            emergency_stops=tuple(self._events.emergency_stops),
            teleports=tuple(self._events.teleports),
            removed=tuple(self._events.removed),
        )
