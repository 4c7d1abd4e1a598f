"""The clock of each driver of a log, which starts with its first row: rows as a table of drivers and frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from stylesim.simulation.sumo.episode import Episode
from stylesim.simulation.sumo.paths import Rows
from stylesim.simulation.sumo.recorder import RawLog
from stylesim.simulation.wander import WanderSwitch


@dataclass(frozen=True, eq=False)
class Clocks:
    """Which cell of a table of drivers and frames each row is."""

    driver: Int32[np.ndarray, " row"]
    frame: Int32[np.ndarray, " row"]
    begin: Int32[np.ndarray, " driver"]  # step of each driver's first row

    @classmethod
    def of(cls, driver: Int32[np.ndarray, " row"], step: Int32[np.ndarray, " row"], drivers: int) -> Clocks:
        """The clocks of the rows of so many drivers."""
        begin = np.full(drivers, np.iinfo(np.int32).max, np.int32)
        np.minimum.at(begin, driver, step)
        return cls(driver, step - begin[driver], begin)

    def table(self, values: Rows) -> Float64[np.ndarray, "driver time"]:
        """The values of the rows; 0 where a driver has none."""
        result = np.zeros((len(self.begin), int(self.frame.max(initial=0)) + 1))
        result[self.driver, self.frame] = values
        return result

    def rows(self, table: Float64[np.ndarray, "driver time"]) -> Rows:
        """The cells of the rows."""
        return np.asarray(table[self.driver, self.frame])


def switch_of(log: RawLog, files: Episode, clocks: Clocks, purpose: str) -> WanderSwitch | None:
    """The change of the twin's driver on the way, on the clock of its rows; a null twin's draws for that purpose."""
    step, twin = files.switch_step, files.twin
    if step < 0 or twin is None or twin.driver not in log.driver_ids:
        return None
    agent = log.driver_ids.index(twin.driver)
    stream = files.stream(twin.driver, purpose, step=step) if twin.new_noise else None
    return WanderSwitch(agent, max(0, step - int(clocks.begin[agent])), twin.style, stream)
