from pathlib import Path

import numpy as np
import polars as pl
import pytest

from stylesim.datasets.table_clock import on_frames, step_s
from stylesim.errors import InputError

FILE = Path("tracks.csv")


def table(t, agent="a"):
    return pl.DataFrame({"agent": [agent] * len(t), "t": t}, schema={"agent": pl.String, "t": pl.Float64})


def test_times_become_frames_and_odd_ones_are_counted():
    t = [12.03 + 0.1 * k for k in range(500)] + [15.07, float("nan"), 2e12]
    dropped: dict[str, int] = {}
    found, begin = on_frames(table(t), 0.1, FILE, dropped)
    assert found["frame"].to_list() == list(range(500))
    assert begin == pytest.approx(12.03, abs=1e-3)
    assert dropped == {"unreadable": 2, "off_clock": 1}


def test_a_clock_of_another_rate_is_refused():
    with pytest.raises(InputError, match=r"tracks\.csv.*no clock of 10 Hz"):
        on_frames(table([k / 7 for k in range(100)]), 0.1, FILE, {})


@pytest.mark.parametrize("rate_hz", [1.0, 9.99, 25.0, 29.97, 100.0])
def test_the_rate_is_found_also_in_rounded_times(rate_hz):
    t = np.round(np.arange(1000) / rate_hz, 3)
    assert step_s(table(t.tolist()), FILE) == pytest.approx(1 / rate_hz, rel=1e-3)


@pytest.mark.parametrize("t", [[0.0], [1.0, 1.0], [k * 100.0 for k in range(9)], [k * 1e-6 for k in range(9)]])
def test_times_in_other_units_are_refused(t):
    with pytest.raises(InputError, match=r"other units|different times"):
        step_s(table(t), FILE)
