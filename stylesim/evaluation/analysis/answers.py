"""MDSI x TDBM: what drivers say of themselves against how they drove (the paper's heat map)."""

from __future__ import annotations

import polars as pl

from stylesim.corpus import Corpus
from stylesim.evaluation.analysis.judge import DRIVER
from stylesim.evaluation.analysis.measure import Measured
from stylesim.evaluation.analysis.shares import NAMES
from stylesim.labelers.mdsi import MDSI
from stylesim.labelers.mdsi_key import STYLES

MDSI_NAMES = (*STYLES, "undetermined")


def answers(corpus: Corpus, one: Measured) -> pl.DataFrame:
    """Drivers per (MDSI style, TDBM class), zeros too; no row where nobody in the corpus answered.

    A tie for the greatest MDSI score, or too many missing items, is "undetermined".
    """
    labeler = MDSI().fit(corpus)
    empty = {"corpus": pl.String, "mdsi": pl.String, "tdbm": pl.String, "count": pl.Int64}
    if not labeler.provenance_["drivers_with_answers"]:
        return pl.DataFrame(schema=empty)
    said: dict[tuple[str, str], str] = {}
    for scene in corpus:
        found = labeler.label_windows(scene)
        for row, agent in enumerate(found.agent_id):
            if not found.missing[row].all():
                said[scene.unit_id, agent] = found.class_name(row)
    drove = one.drivers.select(*DRIVER, "tdbm").iter_rows()
    pairs = [(said[unit, agent], style) for unit, agent, style in drove if (unit, agent) in said]
    rows = [
        {"corpus": one.name, "mdsi": mdsi, "tdbm": tdbm, "count": pairs.count((mdsi, tdbm))}
        for tdbm in NAMES
        for mdsi in MDSI_NAMES
    ]
    return pl.DataFrame(rows, schema=empty)
