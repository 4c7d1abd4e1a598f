"""The traffic-light logs of DLR Urban Traffic."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from stylesim.datasets.recording import SignalLog
from stylesim.datasets.tables import csv_table, microseconds
from stylesim.errors import InputError
from stylesim.signals import SignalState

# The codes are not documented with the data; this is our reading, consistent with the cycles of the shipped file:
# 1 dark, 3 red, 4 red and amber (red: no one may go yet), 5 green, 7 yellow. 9 (flashing) and others: unknown.
STATES = {
    1: SignalState.DARK,
    3: SignalState.RED,
    4: SignalState.RED,
    5: SignalState.GREEN,
    7: SignalState.YELLOW,
}
# Chosen: logs come about once a second, the longest silence in the shipped file is 2.0 s.
STALE_S = 3.0


def signal_log(path: Path, begin_us: int) -> SignalLog:
    """What every light showed, on the clock whose zero is `begin_us` (UTC microseconds of the tracks' frame 0).

    The lights are logged on a clock of their own, offset from the tracks'; each log holds from its own time on.
    A light that a log leaves out is unknown until the next one. InputError where no row can be read.
    """
    table = csv_table(path, {"timestamp": pl.String, "id": pl.String, "state": pl.Int64})
    table = table.with_columns(microseconds("timestamp").alias("t")).drop_nulls(["t", "id", "state"])
    if table.is_empty():
        raise InputError(f"{path} has no usable row: no timestamp, id and state can be read")
    times, event = np.unique(table["t"].to_numpy(), return_inverse=True)
    names = sorted(set(table["id"].to_list()), key=lambda name: (len(name), name))
    light = np.array([names.index(name) for name in table["id"].to_list()])
    code = table["state"].to_numpy()
    shown = np.full(len(code), int(SignalState.UNKNOWN), np.int8)
    for number, state in STATES.items():
        shown[code == number] = int(state)
    states = np.zeros((len(names), len(times)), np.int8)
    states[light, event] = shown
    return SignalLog(time_s=(times - begin_us) / 1e6, signal_id=tuple(names), state=states, stale_s=STALE_S)
