"""`calibrate`: behaviours of the six classes that make drivers measure as the class that was commanded."""

from __future__ import annotations

from stylesim.calibration.calibrate import calibrate

__all__ = ["calibrate"]
