"""Fits the shipped `real-reference` labellers on the recording that ships, and measures the shares of styles in it.

    .venv/bin/python tools/make_real_reference.py [--judge CORPUS ...] [--write]

The recording is data/dlr_ut (DLR Urban Traffic, CC BY 4.0; one unit of five minutes at one signalised intersection).
Shares are of drivers with a whole 11 s window, judged by the labeller that was just fitted; `--judge` measures those of
other corpora (`stylesim read`), which had no part in the fit. Without --write nothing in agents/ is touched.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from stylesim.corpus import Corpus
from stylesim.datasets.reading import read
from stylesim.labelers.base import Labeler
from stylesim.labelers.reference import fit_reference, load_labeler, save_labeler, scalers_dir
from stylesim.labels import LabelFlag
from stylesim.resources import data_root
from stylesim.style import STYLE_CLASSES

NAME = "real-reference"
ATTRIBUTION = "DLR Urban Traffic v1.2.0, first five minutes; German Aerospace Center, Zenodo 15754836, CC BY 4.0"


def measured_classes(corpus: Corpus, labeler: Labeler) -> tuple[np.ndarray, int]:
    """Drivers of each class by the mean score over their scenes; and how many had no whole window or no class."""
    total: dict[tuple[str, str], list[np.ndarray]] = {}
    left: set[tuple[str, str]] = set()
    for scene in corpus:
        labels = labeler.label_windows(scene)
        whole = (labels.flags & int(LabelFlag.SHORT | LabelFlag.IMPLAUSIBLE)) == 0
        moved = labels.feature[:, labels.feature_names.index("v_avg")] * 11.0 > 1.0  # the parked drive in no style
        for row, agent in enumerate(labels.agent_id):
            key = (scene.unit_id, agent)
            if whole[row] and labels.style[row] >= 0 and moved[row]:
                total.setdefault(key, []).append(labels.score[row].astype(np.float64))
            else:
                left.add(key)
    best = [int(np.mean(scores, axis=0).argmax()) for scores in total.values()]
    return np.bincount(best, minlength=len(STYLE_CLASSES)), len(left - set(total))


def main() -> None:
    """Read, fit, measure, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--judge", type=Path, nargs="*", default=[])
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        corpus = read("dlr_ut", data_root() / "data" / "dlr_ut", out=Path(folder) / "dlr_ut")
        out = scalers_dir() if asked.write else Path(folder)
        paths = fit_reference(corpus, NAME, out=out)
        for path in paths:
            attributed = load_labeler(path)
            attributed.provenance_ |= {"data": ATTRIBUTION}
            save_labeler(attributed, path)
        labeler = load_labeler(next(path for path in paths if ".tdbm." in path.name))
        fitted: np.ndarray | None = None
        for one in (corpus, *(Corpus(path) for path in asked.judge)):
            count, left = measured_classes(one, labeler)
            share = count / max(1, count.sum())
            fitted = share if fitted is None else fitted
            units = len({info.unit_id for info in one.info})
            text = "  ".join(f"{name} {value:.3f}" for name, value in zip(STYLE_CLASSES, share, strict=True))
            distance = float(np.abs(share - fitted).sum() / 2)
            sys.stdout.write(
                f"{one.path.name}: {count.sum()} drivers of {units} unit(s), {left} not judged: {text}; "
                f"total variation distance to the fit {distance:.2f}\n"
            )
    for path in paths if asked.write else ():
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
