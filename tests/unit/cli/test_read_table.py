"""`read table --map … --unit …` and `label --method mdsi`, as a user types them."""

from typer.testing import CliRunner

from stylesim.cli.main import app
from stylesim.corpus import Corpus
from tests.formats import study_files
from tests.formats.traffic import rows, text


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_a_table_in_feet(tmp_path):
    lines = [(r.agent, r.t, r.x / 0.3048, r.y / 0.3048) for r in rows()]
    (tmp_path / "tracks.csv").write_text(text("track,t,px,py", lines))
    mapping = "id=track,time=t,x=px,y=py"
    result = run("read", "table", tmp_path / "tracks.csv", "--map", mapping, "--unit", "feet", "--out", tmp_path / "c")
    assert result.exit_code == 0, result.output
    (scene,) = Corpus(tmp_path / "c")
    own = [r for r in rows() if r.agent == 2]
    assert abs(scene.tracks.position_m[1, 50, 0] - own[50].x) < 1e-3


def test_a_table_without_meanings_says_how_to_give_them(tmp_path):
    (tmp_path / "tracks.csv").write_text("track,t,px,py\n")
    result = run("read", "table", tmp_path / "tracks.csv", "--out", tmp_path / "c")
    assert result.exit_code != 0
    assert "--map id=" in str(result.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["tracks.csv"]


def test_mdsi_by_name(tmp_path):
    study_files.sample(tmp_path / "study")
    assert run("read", "auto", tmp_path / "study", "--out", tmp_path / "c").exit_code == 0
    result = run("label", tmp_path / "c", "--method", "mdsi")
    assert result.exit_code == 0, result.output
    assert "patient_careful" in result.output
    assert Corpus(tmp_path / "c").has_labels("mdsi", "track")


def test_mdsi_without_answers_is_said(tmp_path):
    (tmp_path / "tracks.csv").write_text(text("id,t,x,y", [(r.agent, r.t, r.x, r.y) for r in rows()]))
    run("read", "table", tmp_path / "tracks.csv", "--map", "id=id,time=t,x=x,y=y", "--out", tmp_path / "c")
    result = run("label", tmp_path / "c", "--method", "mdsi")
    assert result.exit_code != 0
    assert "no driver carries answers" in str(result.exception) + result.output
