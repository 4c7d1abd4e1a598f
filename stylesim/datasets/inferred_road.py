"""x."""

from stylesim.errors import InputError


def infer_road(recording, origin_m):
    raise InputError("x")
