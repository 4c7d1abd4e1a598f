"""The tables of NGSIM, in feet: the portal's CSV with a header, the original text of 18 or 24 columns without one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import polars as pl

from stylesim.datasets.guarding import reading
from stylesim.datasets.maps.units import M_PER_FOOT
from stylesim.datasets.sniffing import head, header
from stylesim.datasets.tables import refusing_malformed
from stylesim.errors import InputError
from stylesim.tracks import AgentKind

SITES = ("us-101", "i-80", "lankershim", "peachtree")
# The order of the original files [read: their documentation]; Lankershim and Peachtree have six more in between.
ORIGINAL_18 = (
    "vehicle_id", "frame_id", "total_frames", "global_time", "local_x", "local_y", "global_x", "global_y", "v_length",
    "v_width", "v_class", "v_vel", "v_acc", "lane_id", "preceding", "following", "space_headway", "time_headway",
)  # fmt: skip
ORIGINAL_24 = (
    *ORIGINAL_18[:14], "o_zone", "d_zone", "int_id", "section_id", "direction", "movement", *ORIGINAL_18[14:],
)  # fmt: skip
_NUMBERS = (
    "frame_id", "global_time", "local_x", "local_y", "global_x", "global_y", "v_length", "v_width", "v_class", "v_vel",
)  # fmt: skip
KINDS = {1: AgentKind.MOTORCYCLE, 2: AgentKind.CAR, 3: AgentKind.TRUCK}  # 3 is "truck and buses" [read]
FRAMES = ("global", "local")


def has_header(path: Path) -> bool:
    """True for a CSV with the portal's columns."""
    return {"vehicle_id", "frame_id", "global_time", "local_x", "v_vel"} <= {n.lower() for n in header(path)}


def is_original(path: Path) -> bool:
    """True for text whose first line has 18 or 24 numbers."""
    fields = head(path).split(b"\n", 1)[0].replace(b",", b" ").split()
    try:
        return len(fields) in (18, 24) and all(float(field) == float(field) for field in fields)
    except ValueError:
        return False


def site_tables(path: Path, frame: str) -> Iterator[tuple[str, pl.DataFrame]]:
    """Each site of a file with its rows, in metres and standard columns, plus `time` (ms) and `frame_id`.

    `frame` "global" is the state plane (x east, y north), "local" the site's own (x to the right, y along the road).
    """
    lazy = _portal(path) if has_header(path) else _original(path)
    with reading(path, "table of NGSIM"):
        with refusing_malformed(path):
            names = lazy.select(pl.col("location").unique()).collect(engine="streaming")["location"].to_list()
        for name in sorted({n or "" for n in names}):
            chosen = pl.col("location").fill_null("") == name
            with refusing_malformed(path):
                table = _standard(lazy.filter(chosen), frame).collect(engine="streaming")
            yield name, table


def _portal(path: Path) -> pl.LazyFrame:
    names = [name.lower() for name in header(path)]
    absent = [name for name in ("vehicle_id", *_NUMBERS) if name not in names]
    if absent:
        raise InputError(f"{path} lacks the columns {', '.join(absent)}; it is no table of NGSIM")
    if len(set(names)) != len(names):
        raise InputError(f"{path} names a column twice in its first line")
    with reading(path, "table of NGSIM"):
        # Everything as text: some exports write numbers with thousands separators.
        lazy = pl.scan_csv(
            path, has_header=False, skip_rows=1, new_columns=names, infer_schema=False, truncate_ragged_lines=True
        )
    if "location" not in names:
        return lazy.with_columns(location=pl.lit(site_of(path)))
    return lazy.with_columns(pl.col("location").str.strip_chars().str.to_lowercase())


def _original(path: Path) -> pl.LazyFrame:
    first = head(path).split(b"\n", 1)[0].replace(b",", b" ").split()
    names = {18: ORIGINAL_18, 24: ORIGINAL_24}.get(len(first))
    if names is None:
        raise InputError(f"{path} is no table of NGSIM: no header, and {len(first)} columns instead of 18 or 24")
    with reading(path, "table of NGSIM"):
        lines = pl.scan_csv(
            path, has_header=False, new_columns=["line"], infer_schema=False, separator="\x01", quote_char=None,
            encoding="utf8-lossy",
        )  # fmt: skip
        fields = pl.col("line").str.extract_all(r"[^\s,]+")
        lazy = lines.filter(pl.col("line").str.strip_chars() != "").with_columns(fields=fields)
        cut = [pl.col("fields").list.get(i, null_on_oob=True).alias(name) for i, name in enumerate(names)]
        return lazy.select(*cut).with_columns(location=pl.lit(site_of(path)))


def site_of(path: Path) -> str:
    """The site that the file's path names, else the name of the file."""
    text = str(path).lower().replace("us101", "us-101").replace("i80", "i-80")
    parts = text.rsplit("/", 3)
    return next((site for part in reversed(parts) for site in SITES if site in part), path.stem.lower())


def _standard(lazy: pl.LazyFrame, frame: str) -> pl.LazyFrame:
    numbers = {
        name: pl.col(name).str.replace_all(",", "").str.strip_chars().cast(pl.Float64, strict=False)
        for name in _NUMBERS
    }
    kinds = {float(code): int(kind) for code, kind in KINDS.items()}
    return lazy.select(
        agent=pl.col("vehicle_id").str.replace_all(",", "").str.strip_chars(),
        frame_id=numbers["frame_id"],
        time=numbers["global_time"],
        x=numbers[f"{frame}_x"] * M_PER_FOOT,
        y=numbers[f"{frame}_y"] * M_PER_FOOT,
        speed=numbers["v_vel"] * M_PER_FOOT,
        length=numbers["v_length"] * M_PER_FOOT,
        width=numbers["v_width"] * M_PER_FOOT,
        kind=numbers["v_class"].replace_strict(kinds, default=int(AgentKind.OTHER), return_dtype=pl.Int8),
    )
