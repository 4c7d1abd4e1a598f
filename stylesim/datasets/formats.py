"""Which foreign formats can be read, and what each of them offers."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

from stylesim.errors import unknown
from stylesim.scene import Scene


@dataclass(frozen=True)
class DatasetFormat:
    """One foreign format. `module` has `scenes(path, **options) -> Iterator[Scene]`."""

    name: str
    module: str
    description: str
    rate_hz: float
    has_map: bool
    has_signals: bool
    licence: str
    where: str
    options: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()  # those of the options that are positive numbers

    def scenes(self) -> Callable[..., Iterator[Scene]]:
        """The reader's `scenes` function; its module is imported now."""
        return cast("Callable[..., Iterator[Scene]]", importlib.import_module(self.module).scenes)


FORMATS: dict[str, DatasetFormat] = {
    f.name: f
    for f in (
        DatasetFormat(
            name="dlr_ut",
            module="stylesim.datasets.dlr_ut",
            description="DLR Urban Traffic: signalised intersection in Braunschweig, boxes and lights (CSV)",
            rate_hz=20.0,
            has_map=False,
            has_signals=True,
            licence="CC BY 4.0",
            where="https://doi.org/10.5281/zenodo.15754836",
            options=("scene_s", "road"),
            numbers=("scene_s",),
        ),
        DatasetFormat(
            name="av2",
            module="stylesim.datasets.av2",
            description="Argoverse 2 motion forecasting: 11 s scenarios of six US cities with map (Parquet, JSON)",
            rate_hz=10.0,
            has_map=True,
            has_signals=False,
            licence="CC BY-NC-SA 4.0",
            where="https://www.argoverse.org/av2.html",
        ),
    )
}


def dataset_format(name: str) -> DatasetFormat:
    """The format of that name; InputError naming the nearest known one if there is none."""
    if name not in FORMATS:
        raise unknown("data format", name, FORMATS)
    return FORMATS[name]
