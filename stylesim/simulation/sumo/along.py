"""What moves a vehicle along its way: SUMO's speed, as the driver's foot carries it out (`simulation.foot`)."""

from __future__ import annotations

from dataclasses import replace

from stylesim.simulation.foot import footed
from stylesim.simulation.sumo.clocks import Clocks, switch_of
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.paths import Rows
from stylesim.simulation.sumo.recorder import RawLog
from stylesim.style import DriverStyle

PURPOSE = "pedal"  # of the drivers' random streams


def pressed(style: DriverStyle, files: Episode) -> DriverStyle:
    """The style as far as the foot is concerned: it is calm where SUMO moves the pedal already."""
    return replace(style, pedal_noise_mps2=0.0) if files.pedal_by_sumo else style


def feet(log: RawLog, files: Episode, clocks: Clocks, model_mps: Rows) -> tuple[Rows, Rows]:
    """How far each row is ahead of where SUMO had it, m, and its speed, m/s; from SUMO's speeds."""
    switch = switch_of(log, files, clocks, PURPOSE)
    ahead, speed = footed(
        [pressed(files.drivers[name].style, files) for name in log.driver_ids],
        clocks.table(model_mps),
        dt_s=DT_S,
        streams=[files.stream(name, PURPOSE) for name in log.driver_ids],
        switch=None if switch is None else replace(switch, style=pressed(switch.style, files)),
    )
    return clocks.rows(ahead), clocks.rows(speed)
