"""How renderers are measured beside each other: seconds to an error, and peers that are not there."""

import os

import numpy as np
import pytest
from references import Reference
from references.peers import Recorder
from references.peers.__main__ import Peer, measured
from references.peers.score import Point, reached, scored


def points(*pairs):
    return [Point(seconds, relmse, 0.0) for seconds, relmse in pairs]


def test_the_seconds_to_an_error_are_exact_where_it_falls_as_a_power_of_time():
    """An error of .4 / t is .02 at 20 s, wherever the pictures are taken."""
    falling = points(*[(t, 0.4 / t) for t in (1.0, 7.0, 33.0, 100.0)])
    assert reached(falling, 0.02) == "20"
    assert reached(falling, 0.1) == "4.00"


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        ([(0.3, 0.01), (0.9, 0.004)], "≤ 0.30"),
        ([(1.0, 0.4), (4.0, 0.1), (8.0, 0.05)], "> 8.00"),
        ([(1.0, 0.05), (2.0, 0.041), (4.0, 0.04), (8.0, 0.04)], "floor"),
        ([(1.0, 0.04), (1.5, 0.04)], "> 1.50"),  # too close to tell
    ],
)
def test_what_is_not_reached_between_pictures_is_said(pairs, said):
    assert reached(points(*pairs), 0.02) == said


def test_what_a_renderer_leaves_is_compared(tmp_path):
    """Twice as bright: a bias of 1 and, but for the regulariser, a relMSE of 1 less the own error."""
    recorder = Recorder(tmp_path, limit=10.0)
    recorder.ready("one", start_up=2.5)
    truth = np.ones((2, 3, 3), np.float32)
    recorder.add(1.5, 2.0 * truth)
    recorder.add(0.5, truth)
    run = scored(tmp_path, Reference(truth, {"whole": truth[..., 0] > 0.0}, {"whole": 0.1}), launched=0.0)
    first, point = run.points["whole"]
    assert (first.seconds, first.bias) == (0.5, 0.0)
    assert (run.title, run.start_up, point.seconds) == ("one", 2.5, 1.5)
    assert point.bias == pytest.approx(1.0)
    assert point.relmse == pytest.approx(1.0 / 1.001 - 0.1)


def test_pictures_are_kept_at_growing_distances_and_at_the_end(tmp_path):
    recorder = Recorder(tmp_path, limit=10.0)
    recorder.add(8.0, np.zeros((1, 1, 3)))
    assert not recorder.due(9.0)
    assert recorder.due(10.0)


@pytest.mark.skipif(os.name == "nt", reason="interpreters are shell scripts")
@pytest.mark.parametrize(
    ("does", "said"),
    [
        (
            "echo \"Traceback\nModuleNotFoundError: No module named 'lux'\" >&2; exit 1",
            "not installed: No module",
        ),
        ("kill -ABRT $$", "exit code -6"),
        ("exit 0", "no picture"),
        (None, "no interpreter"),
    ],
)
def test_a_peer_that_is_missing_or_crashes_is_one_line(monkeypatch, tmp_path, does, said):
    monkeypatch.setattr("references.peers.__main__.outside", lambda: tmp_path)
    monkeypatch.setattr("references.peers.__main__.load", lambda path: None)
    monkeypatch.setattr("references.peers.__main__.describe", lambda scene: {})
    python = tmp_path / "python"
    if does is not None:
        python.write_text(f"#!/bin/sh\n{does}\n")
        python.chmod(0o755)
    run, remark = measured(Peer("one", "luxcore"), "A", 1.0, str(python))
    assert run is None
    assert remark.startswith("left out: ")
    assert said in remark
    assert "\n" not in remark
