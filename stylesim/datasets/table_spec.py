"""What the columns of a user's own table mean: given on the command line, or in a YAML file beside the table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from stylesim.datasets.maps.units import M_PER_FOOT, MPS_PER_KMH, MPS_PER_MPH
from stylesim.errors import InputError, unknown
from stylesim.specs import Spec, load_yaml, parse

LENGTH_UNITS = {"metres": 1.0, "feet": M_PER_FOOT, "kilometres": 1000.0, "centimetres": 0.01}
SPEED_UNITS = {"m/s": 1.0, "km/h": MPS_PER_KMH, "mph": MPS_PER_MPH, "ft/s": M_PER_FOOT}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# What a table can tell. `id`, `x`, `y` and one of `time` and `frame` are needed.
TARGETS = (
    "id", "time", "frame", "x", "y", "vx", "vy", "speed", "heading", "length", "width", "kind", "recording",
)  # fmt: skip
SIDECAR = ".columns.yaml"
_Positive = Annotated[float, Field(gt=0)]


class TableSpec(Spec):
    """Columns and units of a table. Units apply to all columns of their sort; speeds default to the unit of lengths."""

    columns: dict[str, str]  # target -> column of the table
    unit: str = "metres"  # of places and sizes; or a number of metres: "0.1" for decimetres, or metres per pixel
    speed_unit: Literal["m/s", "km/h", "mph", "ft/s", "per second"] = "per second"  # "per second": lengths' unit per s
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    rate_hz: _Positive | None = None  # of `frame`, or where the times do not tell it
    angle: Literal["radians", "degrees", "compass degrees"] = "radians"  # compass: clockwise from north (+y)
    y_axis: Literal["up", "down"] = "up"  # down: of an image
    position: Literal["centre", "front"] = "centre"
    kind: str = "car"  # of every row, where there is no such column
    separator: str = ","
    site: str = "unknown_site"

    @property
    def metres(self) -> float:
        """Metres per unit of length. InputError for a unit that is none."""
        if self.unit in LENGTH_UNITS:
            return LENGTH_UNITS[self.unit]
        try:
            value = float(self.unit)
        except ValueError:
            raise unknown("unit", self.unit, LENGTH_UNITS) from None
        if not 1e-6 < value < 1e6:
            raise InputError(f"a unit of {self.unit} metres makes no sense; known: {', '.join(LENGTH_UNITS)}, a number")
        return value

    @property
    def metres_per_second(self) -> float:
        """m/s per unit of speed."""
        return self.metres if self.speed_unit == "per second" else SPEED_UNITS[self.speed_unit]

    def checked(self, where: Path | str) -> TableSpec:
        """This, if it can be read; InputError naming what is missing, unknown or said twice."""
        for target in self.columns:
            if target not in TARGETS:
                raise unknown("meaning of a column", target, TARGETS, where=where)
        absent = [target for target in ("id", "x", "y") if target not in self.columns]
        if absent:
            raise InputError(f"{where}: no column is named for {', '.join(absent)}; say it with map {absent[0]}=COLUMN")
        if ("time" in self.columns) == ("frame" in self.columns):
            raise InputError(f"{where}: name a column for either time or frame")
        if "frame" in self.columns and self.rate_hz is None:
            raise InputError(f"{where}: frames need a rate: rate_hz=10, say")
        if ("vx" in self.columns) != ("vy" in self.columns):
            raise InputError(f"{where}: velocities need both vx and vy")
        if len(self.separator) != 1:
            raise InputError(f"{where}: the separator is one character, not {self.separator!r}")
        _ = self.metres
        return self


def spec_from_text(text: str, **options: str | float | None) -> TableSpec:
    """The spec of "x=center_x,y=center_y,id=track,time=t" and of options such as unit="feet"."""
    columns: dict[str, str] = {}
    for item in text.split(","):
        target, equals, column = item.partition("=")
        target = target.strip()
        if not equals or not column.strip():
            raise InputError(f"map: expected MEANING=COLUMN,…, found {item!r}; meanings are {', '.join(TARGETS)}")
        if target in columns:
            raise InputError(f"map: {target} is named twice")
        columns[target] = column.strip()
    given = {key: value for key, value in options.items() if value is not None}
    return parse(TableSpec, {"columns": columns, **given}, "the options of the table").checked("map")


def sidecar_of(table: Path) -> Path:
    """The YAML file that says what a table's columns mean: tracks.csv -> tracks.columns.yaml."""
    name = table.name
    for ending in (".gz", ".csv", ".parquet", ".txt"):
        name = name.removesuffix(ending)
    return table.with_name(name + SIDECAR)


def spec_from_file(path: Path) -> TableSpec:
    """The spec in a YAML file; InputError naming file and field, or what to do where there is none."""
    if not path.is_file():
        raise InputError(
            f"no such file: {path}; it says what the columns of the table mean. Write it, or give the meanings with "
            "--map id=track,time=t,x=center_x,y=center_y,… (`stylesim describe table`)"
        )
    return load_yaml(TableSpec, path).checked(path)
