"""Construction checks shared by the frozen array types."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def frozen(array: Any, dtype: npt.DTypeLike, shape: tuple[int | None, ...], name: str) -> npt.NDArray[Any]:
    """`array` as a read-only array of that dtype; ValueError if its shape is not `shape` (None: any length).

    Any real dtype is taken and stored as `dtype`; the input is copied unless it is read-only already.
    """
    result = np.asarray(array, dtype=dtype)
    have = result.shape
    # Most calls are for lines of a map, by the hundred: no generator, and no comparison where the shape is exact.
    if have != shape and not (len(have) == len(shape) and _fits(have, shape)):
        wanted = tuple("any" if n is None else n for n in shape)
        raise ValueError(f"{name} has shape {have}, wanted {wanted}")
    if result.flags.writeable:
        result = result.copy() if np.may_share_memory(result, array) else result
        result.flags.writeable = False
    return result


def _fits(have: tuple[int, ...], want: tuple[int | None, ...]) -> bool:
    return all(wanted in (None, one) for one, wanted in zip(have, want, strict=True))
