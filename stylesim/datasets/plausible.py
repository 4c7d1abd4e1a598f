"""Are these numbers metres, metres per second and degrees, as the columns say? Wrong units are refused, not read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from stylesim.errors import InputError

# UTM by definition: eastings of one zone, northings of one hemisphere.
_EASTING_M, _NORTHING_M = (100_000.0, 900_000.0), (0.0, 10_000_000.0)
MAX_SPEED_MPS = 70.0  # chosen, because nothing on a road is faster than 252 km/h
MIN_SIDE_M = 0.01  # chosen: nothing that is a road user is thinner
MAX_LENGTH_M, MAX_WIDTH_M = 30.0, 5.0  # chosen: the longest road train of the EU is 25.25 m long and 2.6 m wide
MAX_DISTANCE_M = 20_000.0  # chosen: farther from the middle nothing is in view of one vehicle, drone or mast
MOVING_MPS = 3.0  # chosen: above it direction and speed are sure (yaw within 1.1 degrees of the velocity)
MIN_ROWS = 50  # chosen: fewer moving rows do not prove that a unit is wrong
SPEED_RATIO = (0.7, 1.4)  # chosen: km/h would give 0.28, feet 0.30
MAX_YAW_ERROR_RAD = 0.5  # chosen: radians or a clockwise angle give medians about 1.5


def row() -> pl.Expr:
    """True for a row whose numbers can be those of a road user in UTM metres."""
    return (
        pl.col("center_easting").is_between(*_EASTING_M)
        & pl.col("center_northing").is_between(*_NORTHING_M)
        & (pl.col("velocity_easting").pow(2) + pl.col("velocity_northing").pow(2) <= MAX_SPEED_MPS**2)
        & pl.col("dimension_length").is_between(MIN_SIDE_M, MAX_LENGTH_M)
        & pl.col("dimension_width").is_between(MIN_SIDE_M, MAX_WIDTH_M)
    )


def nearby(table: pl.DataFrame) -> pl.Expr:
    """True for a row that is within half of MAX_DISTANCE_M of the middle of all rows: no two are farther apart."""
    names = ("center_easting", "center_northing")
    return pl.all_horizontal(*((pl.col(n) - table[n].median()).abs() <= MAX_DISTANCE_M / 2 for n in names))


def whole_file(table: pl.DataFrame, path: Path) -> None:
    """Refuse a file in other units: positions, velocities and yaw must agree with one another. Raises InputError.

    `table` has the source's columns and `frame` at 20 Hz.
    """
    east, north = table["center_easting"].to_numpy(), table["center_northing"].to_numpy()
    if not (_EASTING_M[0] <= np.median(east) <= _EASTING_M[1] and _NORTHING_M[0] <= np.median(north) <= _NORTHING_M[1]):
        raise InputError(
            f"{path}: positions about ({np.median(east):.1f}, {np.median(north):.1f}) are no UTM metres; "
            "are they pixels, degrees or a local frame?"
        )
    ordered = table.sort("id", "frame")
    motion = ordered.select(
        next=(pl.col("id").shift(-1) == pl.col("id")) & (pl.col("frame").shift(-1) == pl.col("frame") + 1),
        step=(
            (pl.col("center_easting").diff().shift(-1)).pow(2) + (pl.col("center_northing").diff().shift(-1)).pow(2)
        ).sqrt(),
        speed=(pl.col("velocity_easting").pow(2) + pl.col("velocity_northing").pow(2)).sqrt(),
        course=pl.arctan2("velocity_northing", "velocity_easting"),
        yaw=pl.col("yaw").radians(),
    ).filter(pl.col("next") & (pl.col("speed") > MOVING_MPS))
    if motion.height < MIN_ROWS:
        return
    ratio = float(np.median(motion["step"].to_numpy() / 0.05 / motion["speed"].to_numpy()))
    if not SPEED_RATIO[0] <= ratio <= SPEED_RATIO[1]:
        raise InputError(
            f"{path}: positions move {ratio:.2f} times as fast as the velocities say; "
            "velocities must be m/s and positions metres at 20 Hz"
        )
    turned = motion["yaw"].to_numpy() - motion["course"].to_numpy()
    error = float(np.median(np.abs(np.remainder(turned + np.pi, 2 * np.pi) - np.pi)))
    if error > MAX_YAW_ERROR_RAD:
        raise InputError(
            f"{path}: yaw is {np.degrees(error):.0f} degrees off the direction of motion; "
            "it must be degrees counter-clockwise from east"
        )
