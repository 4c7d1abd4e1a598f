from pathlib import Path

import numpy as np
import polars as pl
import pytest

from stylesim.datasets.motion import COURSE_M
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError
from stylesim.tracks import AgentKind
from tests.formats.traffic import rows

FILE = Path("tracks.csv")


def made(**options):
    return pl.DataFrame([vars(r) | {"agent": str(r.agent), "kind": int(r.kind)} for r in rows(**options)]).drop("t")


def read(table, **options):
    return recording_of(table, Source(FILE, "r", 0.1, {}), **options)[0]


def test_values_are_kept():
    recording, origin = recording_of(made(), Source(FILE, "r", 0.1, {}))
    assert recording.agent_id == ("1", "2", "3", "4", "5", "6", "7")
    assert len(recording.frame) == made().height
    assert origin.tolist() == [0.0, 0.0]
    one = made().filter(pl.col("agent") == "3").sort("frame")
    own = recording.agent == 2
    np.testing.assert_array_equal(recording.position_m[own], one.select("x", "y").to_numpy())
    np.testing.assert_allclose(recording.size_m[2], [4.5, 1.8], atol=1e-6)
    assert recording.kind.tolist() == [1, 1, 1, 1, 1, 2, 6]


def test_motion_is_made_where_it_is_missing():
    full = read(made())
    bare = read(made().drop("vx", "vy", "heading", "length", "width"))
    assert bare.notes["tracks_size_by_kind"] == 7
    later = bare.frame > 0
    close = np.hypot(*(bare.velocity_mps - full.velocity_mps).T)[later]
    assert close.max() < 0.06  # half a step of 0.75 m/s2
    moving = (bare.lookahead == 0) & (bare.kind[bare.agent] != AgentKind.PEDESTRIAN)
    assert np.abs(bare.heading_rad - full.heading_rad)[moving].max() < 0.02
    assert 0 < bare.lookahead.max() <= np.ceil(COURSE_M / 0.12)  # the person walks 0.12 m a frame


def test_positions_of_the_front_are_moved_to_the_centre():
    table = made()
    moved = table.with_columns(
        x=pl.col("x") + pl.col("length") / 2 * pl.col("heading").cos(),
        y=pl.col("y") + pl.col("length") / 2 * pl.col("heading").sin(),
    )
    np.testing.assert_allclose(read(moved, front=True).position_m, read(table).position_m, atol=1e-6)


def test_bad_rows_are_counted_by_reason():
    table = made()
    bad = table.head(7).with_columns(
        agent=pl.Series(["1", "1", "1", "1", "99", "98", None]),
        frame=pl.Series([0, 5000, 5001, -3, 5, 5, 5]),
        x=pl.Series([1.0, float("nan"), 1e9, 0.0, 0.0, 0.0, 0.0]),
        length=pl.Series([4.0, 4.0, 4.0, 4.0, -1.0, 80.0, 4.0]),
    )
    recording = read(pl.concat([table, bad]))
    kept = {key: n for key, n in recording.dropped.items() if n}
    assert kept == {"unreadable": 2, "implausible": 4, "duplicate": 1}
    assert len(recording.frame) == table.height


def test_a_parked_car_without_heading_is_dropped_and_said_a_person_is_not():
    still = made().with_columns(x=pl.lit(3.0), y=pl.lit(4.0)).filter(pl.col("agent").is_in(["1", "7"]))
    recording = read(pl.concat([made().filter(pl.col("agent") == "2"), still]).drop("heading", "vx", "vy"))
    assert recording.dropped["heading_unknown"] == 120
    assert recording.agent_id == ("2", "7")
    alone = read(pl.concat([made(), made().head(1).with_columns(agent=pl.lit("z"))]).drop("vx", "vy", "heading"))
    assert alone.dropped["velocity_unknown"] == 1


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda t: t.with_columns(pl.col("x", "y") / 0.3048), "positions move 3.2"),
        (lambda t: t.with_columns(pl.col("vx", "vy") * 3.6), "positions move 0.2"),
        (lambda t: t.with_columns(pl.col("length") / 0.3048), "lengths must be metres"),
        (lambda t: t.with_columns(pl.col("heading").degrees() + 90), "degrees off"),
        (lambda t: t.with_columns(pl.col("x", "y") * 10).drop("vx", "vy", "heading"), "faster than"),
        (lambda t: t.with_columns(x=pl.lit(None, pl.Float64)), "no usable row"),
        (lambda t: t.with_columns(pl.col("length") * 1000), "damaged or in other units"),
    ],
)
def test_other_units_are_refused(spoil, says):
    with pytest.raises(InputError, match=says) as error:
        read(spoil(made()))
    assert "tracks.csv" in str(error.value)
