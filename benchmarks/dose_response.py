"""What synthetic drivers of rare styles buy on a real recording: 0, 10, 30 and 100 % of every batch.

    python -m benchmarks.dose_response [--recording dlr_ut] [--size mini] [--steps 600] [--seeds 5] [--out runs/dose]

All arms take equally many gradient steps. Controls: the same amount of everyday traffic (population `naturalistic`,
same scenarios and seeds), and no synthetic data but the recording's rare styles drawn more often (`balanced`). 100 %
is a model that has seen no recorded driver, except that the best epoch is chosen on the recording's validation part.
The worst style is chosen once on validation, from the model without synthetic data, and followed on test.

dlr_ut and dlr_ht are one recording each: time blocks with a guard gap, nobody in two of them. us101 are the 32 cuts
of NGSIM US-101 in CommonRoad form, whose times are unknown: cuts that show the same driving stay on one side. All
three are one site, so that nothing here speaks of other sites. Labellers are fitted on the training part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from benchmarks.arms_table import print_table
from benchmarks.worlds import arm_options, folder_of, run, trained
from stylesim.corpus import Corpus, CorpusWriter
from stylesim.datasets.reading import read
from stylesim.experiments.arms import Arm
from stylesim.experiments.results import Experiment
from stylesim.forecasting.robust import RobustSettings
from stylesim.labelers.labelling import label
from stylesim.labelers.reference import new_labeler
from stylesim.merging.merge import merge
from stylesim.simulation.generate import generate
from stylesim.windows import WindowSpec

# Chosen: US-101 is cut to 8 s, so that 2 s + 4 s (nuScenes' history) gives windows in all three recordings.
SPEC = WindowSpec(history_s=2.0, future_s=4.0, stride_s=2.0)
SHARES = (0.4, 0.15, 0.45)  # chosen: with less for test no style has 30 drivers there
DOSES = (10, 30, 100)
BASE = "real"
LEAST_ON_VAL = (10, 1)  # chosen: fewer drivers than may be shown, because it only says where to look on test


@dataclass(frozen=True)
class Recording:
    """One real recording, and the simulated scenarios that look like it."""

    format: str
    scene_s: float | None
    by: str  # TDBM needs lanes, which DLR HT has not; KDSC needs longer scenes than US-101 has
    scenarios: tuple[str, ...]
    site: str = ""  # of a folder with several


RECORDINGS = {
    "dlr_ut": Recording("dlr_ut", 20.0, "kdsc", ("yellow_light",)),
    "us101": Recording("commonroad", None, "tdbm", ("stop_and_go", "ramp_merge"), "USA_US101"),
    "dlr_ht": Recording("dlr_ht", 6.0, "kdsc", ("motorway",)),
}


def recorded(name: str, data: Path, folder: Path) -> Corpus:
    """The recording with splits and labels of whole tracks."""
    what, out = RECORDINGS[name], folder / f"{name}-split"
    if not out.exists():
        options: dict[str, Any] = {} if what.scene_s is None else {"scene_s": what.scene_s}
        source = read(what.format, data / what.format, out=folder / name, resume=True, **options)
        if what.site:
            source = cuts_as_units(source, what.site, folder / f"{name}-cuts")
        merge([source], split=SHARES, seed=0, out=out, spec=SPEC)
    corpus = Corpus(out)
    if not corpus.has_labels(what.by, "track"):
        label(corpus, new_labeler(what.by, history_s=(SPEC.history_s,)).fit(corpus.split("train")), spec=SPEC)
    return corpus


def cuts_as_units(source: Corpus, site: str, out: Path) -> Corpus:
    """The scenes of one site, each a unit of its own, so that `merge` parts those that show different driving."""
    with CorpusWriter(out, source=source.manifest["source"], configuration={"units": "scenes"}) as writer:
        for scene in source:
            if scene.unit_id.endswith(site):
                writer.add(replace(scene, unit_id=f"{scene.unit_id}/{scene.scene_id}"))
        return writer.finish()


def synthetic(scenarios: Sequence[str], population: str, out: Path, *, episodes: int, plain: bool) -> Corpus:
    """Episodes to add; `plain` without road and signals, for a recording that has none."""
    made = generate(scenarios, population, episodes=episodes, seed=11, out=out, resume=True)
    if not plain:
        return made
    bare = out.with_name(out.name + "-bare")
    if bare.exists():
        return Corpus(bare)
    with CorpusWriter(bare, source="sumo", configuration={"road": "taken away"}) as writer:
        for scene in made:
            writer.add(replace(scene, road=None, signals=None))
        return writer.finish()


def arms(rare: Corpus, usual: Corpus, by: str) -> list[Arm]:
    """The doses and the two controls."""
    found = [Arm(BASE), Arm("real-balanced", {"robust": RobustSettings(("balanced",), by=by)})]
    for dose in DOSES:
        for name, corpus in (("rare", rare), ("usual", usual)):
            found.append(Arm(f"{name}-{dose}", {"augment": corpus, "augment_share": dose / 100}))
    return found


def main() -> None:
    parser = arm_options(__doc__, seeds=5, steps=600)
    parser.add_argument("--recording", choices=sorted(RECORDINGS), default="dlr_ut")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--episodes", type=int, default=6, help="of each scenario and population")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    name, what = asked.recording, RECORDINGS[asked.recording]
    corpus = recorded(name, asked.data, asked.out)
    out = folder_of(asked, name)
    if asked.show:
        result = Experiment.load(out)
    else:
        plain = all(not info.road for info in corpus.info)
        rare, usual = (
            synthetic(what.scenarios, crowd, asked.out / f"{name}-{crowd}", episodes=asked.episodes, plain=plain)
            for crowd in ("rare_heavy", "naturalistic")
        )
        result = trained(asked, arms(rare, usual, what.by), corpus, out, spec=SPEC, cache=asked.out / "cache")
    units = {info.unit_id.split("/")[0] for info in corpus.info}
    print(f"{name}, {asked.size}, {asked.steps} steps; site(s): {', '.join(sorted(units))}")
    print_table(result, BASE, what.by, least_on_val=LEAST_ON_VAL, sites=len(units))


if __name__ == "__main__":
    run(main)
