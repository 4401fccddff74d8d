"""What `make drivers` measures by, on pictures whose differences are known."""

import numpy as np
import pytest
from drivers.agreement import agreement, compare
from drivers.validation import _MESSAGE


def noise(seed=0):
    return np.random.default_rng(seed).uniform(0.5, 1.5, (45, 80, 3)).astype(np.float32)


@pytest.mark.parametrize("layer", ["indirect", "depth", "normal", "material"])
def test_a_picture_agrees_with_itself(layer):
    found = agreement(layer, noise(), noise())
    assert (found.mean, found.off, found.worst) == (0.0, 0.0, 0.0)
    assert found.holds


def test_a_picture_that_is_too_dark_by_one_percent_does_not_agree():
    found = agreement("indirect", 0.99 * noise(), noise())
    assert found.mean == pytest.approx(-0.01) and found.off == 0.0 and not found.holds


def test_one_blotch_is_a_share_of_the_blocks():
    """45 x 80 pixels are 6 x 10 blocks, the lowest 5 pixels high."""
    blotched = noise()
    blotched[40:45, 8:16] = 0.0
    found = agreement("direct", blotched, noise())
    assert found.off == pytest.approx(1 / 60) and found.worst == pytest.approx(1.0, abs=1e-3)
    assert not found.holds


def test_noise_that_leaves_the_blocks_alone_agrees():
    flipped = noise()
    flipped[:, ::2], flipped[:, 1::2] = noise()[:, 1::2], noise()[:, ::2]
    assert agreement("direct", flipped, noise()).holds


def test_as_many_blocks_may_be_off_as_moved_edges_or_a_tenth_of_other_seeds(tmp_path):
    pictures = {name: noise() for name in ("folder", "reference", "aside", "seed")}
    pictures["folder"][:8, :16] = 0.0  # 2 of 60 blocks
    pictures["aside"][:8, :8] = 0.0
    pictures["seed"] *= 1.1  # all of them: 6
    for name, picture in pictures.items():
        (tmp_path / name).mkdir()
        np.savez(tmp_path / name / "scene.npz", indirect=picture)
    folder, reference, aside, seed = (tmp_path / name for name in pictures)
    strict, moved, sampled = (
        compare("scene.npz", folder, reference, *others)["indirect"]
        for others in ((None, None), (aside, None), (aside, seed))
    )
    assert strict.off == moved.off == sampled.off == pytest.approx(2 / 60)
    assert [each.bound for each in (strict, moved, sampled)] == pytest.approx([0.002, 1 / 60, 6 / 60])
    assert compare("none.npz", folder, reference) == {}


def test_where_nothing_should_be_anything_is_too_much():
    black, one = np.zeros((16, 16, 3)), np.zeros((16, 16, 3))
    one[3, 3] = 1.0
    assert agreement("emission", black, black).holds and not agreement("emission", one, black).holds


def test_ids_are_the_same_or_not():
    ids = np.zeros((800, 8), np.int32)
    few, many = ids.copy(), ids.copy()
    few[0, :3] = 7  # of 64, in one block of 100
    many[0, :4] = -1
    assert agreement("instance", few, ids).holds and not agreement("instance", many, ids).holds


def test_background_at_infinity_has_no_weight_of_its_own():
    depth = np.full((16, 16), 2.0, np.float32)
    depth[:, 8:] = np.inf
    assert agreement("depth", depth * np.float32(1.001), depth).mean == pytest.approx(-0.001, rel=0.01)


def test_messages_of_the_layer_are_told_from_its_greeting():
    said = (
        "UNASSIGNED-khronos-validation-createinstance-status-message(INFO / SPEC): msgNum: -6\n"
        "    Objects: 1\n"
        "VUID-vkCmdDraw-None-02699(ERROR / SPEC): msgNum: -1 - Validation Error: [ VUID ]\n"
        "UNASSIGNED-BestPractices-SemaphoreCount(WARN / PERF): msgNum: 1 - Validation Warning\n"
    )
    assert [line.split("(")[1].split()[0] for line in _MESSAGE.findall(said)] == ["ERROR", "WARN"]
