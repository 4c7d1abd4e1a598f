"""Videos: the frames that were asked for, the colours of the styles, and what cannot be written."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from stylesim.errors import InputError, MissingDependencyError
from stylesim.report.animation import save_video, shown_frames
from stylesim.report.theme import style_colour
from tests.conftest import make_scene


def test_a_gif_has_a_picture_per_frame_that_moves(tmp_path):
    scene = make_scene()
    path = save_video(scene, tmp_path / "a.gif", start_s=5.0, seconds=0.5, follow="car-1")
    with Image.open(path) as video:
        assert (video.n_frames, video.info["duration"]) == (5, 100)
        pictures = []
        for frame in (0, 4):
            video.seek(frame)
            pictures.append(np.array(video.convert("RGB"), np.int16))
    assert np.abs(pictures[0] - pictures[1]).max() > 100
    colour = np.array([int(style_colour(scene.tracks.driver[1].name)[i : i + 2], 16) for i in (1, 3, 5)])
    middle = pictures[0][180:330, 380:500].reshape(-1, 3)  # who is followed is in the middle
    assert (np.abs(middle - colour).max(axis=1) < 24).sum() > 20


def test_the_same_scene_gives_the_same_bytes(tmp_path):
    one, two = (save_video(make_scene(), tmp_path / name, start_s=1.0, seconds=0.3) for name in ("a.gif", "b.gif"))
    assert one.read_bytes() == two.read_bytes()


def test_a_scene_without_road_lights_or_anybody_can_be_shown(tmp_path):
    scene = make_scene(with_road=False)
    empty = scene.tracks.select(scene.tracks.kind == 9)
    from dataclasses import replace

    assert save_video(replace(scene, tracks=empty), tmp_path / "a.gif", start_s=0.0, seconds=0.2).is_file()


def test_frames_are_those_asked_for():
    scene = make_scene()
    assert shown_frames(scene, 2.0, 3.0) == (20, 50)
    assert shown_frames(scene, 12.0, 9.0) == (120, 130)
    assert shown_frames(scene, None, 5.0, "car-4")[0] == 32
    with pytest.raises(InputError, match="lasts 13 s"):
        shown_frames(scene, 13.0, 1.0)
    with pytest.raises(InputError, match="no road user 'car-9'"):
        shown_frames(scene, None, 1.0, "car-9")


def test_an_mp4_goes_through_ffmpeg(tmp_path, monkeypatch):
    fake = tmp_path / "ffmpeg"
    fake.write_text('#!/bin/sh\nfor last; do :; done\nwc -c > "$last"\n')
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    path = save_video(make_scene(), tmp_path / "a.mp4", start_s=0.0, seconds=0.3)
    assert int(path.read_text()) == 3 * 880 * 506 * 3
    fake.write_text("#!/bin/sh\ncat > /dev/null\necho no such codec >&2\nexit 1\n")
    with pytest.raises(InputError, match="no such codec"):
        save_video(make_scene(), tmp_path / "b.mp4", start_s=0.0, seconds=0.3)
    assert not (tmp_path / "b.mp4").exists()


def test_what_cannot_be_written_is_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"\.gif or \.mp4"):
        save_video(make_scene(), tmp_path / "a.avi")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingDependencyError, match="ffmpeg"):
        save_video(make_scene(), tmp_path / "a.mp4")
