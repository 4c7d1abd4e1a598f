"""A driving study: drives in a simulator and answers to the MDSI, written by the tests."""

from __future__ import annotations

from pathlib import Path

from stylesim.questionnaire import N_ITEMS
from tests.formats.traffic import Row, rows, text

SPEC = """
tracks: "drives/*.csv"
table: {columns: {id: id, time: t, x: x, y: y, length: length, width: width, kind: kind}, site: simulator}
answers: answers.csv
items: "q{item}"
driver: file
ego: "1"
"""


def answers(*, missing: tuple[int, ...] = (), low: int = 2) -> list[object]:
    """44 answers; `missing` items are empty."""
    return ["" if i in missing else 1 + (low + i) % 6 for i in range(1, N_ITEMS + 1)]


def write(folder: Path, given: dict[str, list[object]] | None = None, table: list[Row] | None = None) -> Path:
    """The study's folder with one drive per participant."""
    (folder / "drives").mkdir(parents=True)
    given = {"P1": answers(), "P2": answers(low=3, missing=(4, 9))} if given is None else given
    table = rows() if table is None else table
    drive = text(
        "id,t,x,y,length,width,kind",
        [(r.agent, r.t, r.x, r.y, r.length, r.width, r.kind.name.lower()) for r in table],
    )
    for who in given:
        (folder / "drives" / f"{who}.csv").write_text(drive)
    header = ",".join(["participant", *(f"q{i}" for i in range(1, N_ITEMS + 1))])
    (folder / "answers.csv").write_text(text(header, [(who, *values) for who, values in given.items()]))
    (folder / "study.yaml").write_text(SPEC)
    return folder


def sample(folder: Path) -> Path:
    """Two participants, one with missing answers."""
    return write(folder)
