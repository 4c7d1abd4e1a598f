"""A forecaster by name: a trained model's folder, a baseline, a model file, a prediction file, or an entry point."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.forecast import Forecaster
from stylesim.forecasting.baselines import ConstantTurnRate, ConstantVelocity
from stylesim.forecasting.entry_points import from_entry_point, is_entry_point
from stylesim.forecasting.fan import KinematicFan
from stylesim.forecasting.road_baselines import IdmRollout, LaneFollowing
from stylesim.scene import Scene
from stylesim.windows import WindowSpec

BASELINES: dict[str, Callable[[], Forecaster]] = {
    ConstantVelocity.name: ConstantVelocity,
    ConstantTurnRate.name: ConstantTurnRate,
    LaneFollowing.name: LaneFollowing,
    IdmRollout.name: IdmRollout,
}
AV2_SUFFIX = ".parquet"
AT = "@"  # FOLDER@STYLE
WAYMO_SUFFIXES = (".binproto", ".bin", ".pb", ".gz", ".tar", ".tgz")


def open_forecaster(
    name: str, *, train: Callable[[], Iterable[Scene]] | None = None, spec: WindowSpec | None = None
) -> Forecaster:
    """The forecaster that `name` means.

    A baseline's name; the folder of a trained model, or FOLDER@STYLE to ask it always with that style (a class, "none"
    or "marginal"); `pkg.module:factory`; a model file (.pt, .pt2, .onnx with a JSON
    beside it); predictions made elsewhere (Argoverse 2 .parquet; Waymo .binproto or .tar.gz). `kinematic_fan` is fitted
    on the scenes that `train` gives. InputError if it is none of them.
    """
    if name in BASELINES:
        return BASELINES[name]()
    if name == KinematicFan.name:
        if train is None:
            raise InputError(
                f"{name} is fitted on a training split; this corpus has none (`stress` takes one by --fit-on)"
            )
        return KinematicFan().fit(train(), spec or WindowSpec())
    path = Path(name)
    if AT in name and not path.exists():
        return _as_style(name)
    if path.is_file():
        return _from_file(path)
    if path.is_dir():
        from stylesim.forecasting.checkpoint import load

        return load(name)
    if is_entry_point(name):
        return from_entry_point(name)
    raise unknown("forecaster", name, [*BASELINES, KinematicFan.name], where="baselines, files, folders, entry points")


def training_split(corpus: Corpus) -> Callable[[], Iterable[Scene]] | None:
    """What gives the scenes of a corpus' training split; None where it has none."""
    if any(info.split == "train" for info in corpus.info):
        return lambda: corpus.split("train")
    return None


def _as_style(name: str) -> Forecaster:
    """A trained model that is asked with one style: runs/model@timid."""
    folder, _, style = name.rpartition(AT)
    if not Path(folder).exists():
        raise InputError(f"no such model: {folder} (of {name}, which asks it with the style {style!r})")
    from stylesim.forecasting.checkpoint import load
    from stylesim.forecasting.marginal import AsStyle

    return AsStyle(load(folder), style)


def _from_file(path: Path) -> Forecaster:
    from stylesim.forecasting.exported import SUFFIXES, model_file

    if path.suffix == ".pt" and not path.with_suffix(".json").is_file():
        from stylesim.forecasting.checkpoint import load

        return load(path)  # a checkpoint of ours by its file, or refused as none
    if path.suffix in SUFFIXES:
        return model_file(path)
    if path.suffix == AV2_SUFFIX:
        from stylesim.forecasting.av2_submission import av2_predictions

        return av2_predictions(path)
    if path.suffix in WAYMO_SUFFIXES:
        from stylesim.forecasting.waymo_submission import waymo_predictions

        return waymo_predictions(path)
    raise InputError(
        f"{path}: no forecaster is read from a {path.suffix or 'nameless'} file; known are models "
        f"({', '.join(SUFFIXES)}), Argoverse 2 predictions ({AV2_SUFFIX}) and Waymo ones ({', '.join(WAYMO_SUFFIXES)})"
    )
