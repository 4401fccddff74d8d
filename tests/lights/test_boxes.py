"""Boxes: densities of directions to their points, what they show to one, and those that lines pass."""

import math

import numpy as np
import pytest

from ispm.lights.boxes import (
    NO_BOXES,
    Boxes,
    box_pdf,
    box_shadow,
    draw_in_box,
    draw_on_box,
    joined_boxes,
    meets_box,
    meets_middle,
    upright_boxes,
)
from ispm.lights.fitted_boxes import cell_weights, even_shares, fit_boxes, lined_boxes
from ispm.optics.jit import jit
from ispm.optics.vector import vec3

f32 = np.float32


def turned_box(lengths=(0.1, 0.7, 0.4), middle=(0.3, 2.0, -1.0), angle=0.6) -> Boxes:
    """A box turned about y."""
    c, s = math.cos(angle), math.sin(angle)
    axes = np.array([[[c, 0, s], [0, 1, 0], [-s, 0, c]]], f32)
    return Boxes(np.array([middle], f32), axes, np.array([lengths], f32))


@jit
def _points(boxes, numbers, out):
    for i in range(len(out)):
        p = draw_in_box(boxes, 0, numbers[i, 0], numbers[i, 1], numbers[i, 2])
        for c in range(3):
            out[i, c] = p[c]


@jit
def _outside(boxes, d, numbers, out):
    for i in range(len(out)):
        p = draw_on_box(boxes, 0, vec3(d), numbers[i, 0], numbers[i, 1], numbers[i, 2])
        for c in range(3):
            out[i, c] = p[c]


@jit
def _pdfs(boxes, position, directions, out):
    for i in range(len(out)):
        out[i] = box_pdf(boxes, 0, vec3(position), vec3(directions[i]))


@jit
def _shown(boxes, points, d, meets):
    for i in range(len(meets)):
        meets[i] = meets_box(boxes, 0, vec3(points[i]), vec3(d))
    return box_shadow(boxes, 0, vec3(d))


def directions(count: int, seed: int = 0) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(f32)


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.0), (0.3, 2.1, -0.9)], ids=["outside", "inside"])
def test_densities_are_those_of_directions_to_random_points(position):
    """They add up to 1 over all directions, and in caps to how many points lie there: within four standard
    errors, of the mean of 400,000 directions and of 100,000 points."""
    box, at = turned_box(), np.array(position, f32)
    all_around = directions(400_000)
    pdf = np.empty(len(all_around), f32)
    _pdfs(box, at, all_around, pdf)
    total = 4.0 * math.pi * pdf.astype(float)
    assert total.mean() == pytest.approx(1.0, abs=4.0 * total.std() / math.sqrt(len(total)))
    points = np.empty((100_000, 3), f32)
    _points(box, np.random.default_rng(1).random((len(points), 3), f32), points)
    toward = points - at
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    for axis in toward[:5]:
        inside = (all_around @ axis > 0.97) * total
        share = np.mean(toward @ axis > 0.97)
        error = math.hypot(inside.std() / math.sqrt(len(total)), math.sqrt(share / len(points)))
        assert inside.mean() == pytest.approx(share, abs=4.0 * error)


def test_points_on_a_box_lie_evenly_across_what_it_shows():
    """Lines from them meet the box, and they fill its shadow evenly: of a grid of lines as many meet it as
    its area says, and of squares of that those within the shadow have the same share of points."""
    box, d = turned_box(), np.array((0.48, 0.6, 0.64), f32)
    points = np.empty((40_000, 3), f32)
    _outside(box, d, np.random.default_rng(2).random((len(points), 3), f32), points)
    meets = np.empty(len(points), np.bool_)
    area = _shown(box, points, d, meets)
    assert meets.all()
    across = np.linalg.svd(d[None].astype(float))[2][1:]
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 601), np.linspace(-1.5, 1.5, 601))
    grid = (np.stack([x.ravel(), y.ravel()], axis=1) @ across + box.middles[0]).astype(f32)
    meets = np.empty(len(grid), np.bool_)
    _shown(box, grid, d, meets)
    assert meets.mean() * 9.0 == pytest.approx(area, rel=0.01)  # its outline is some 1 % of it
    places = (points - box.middles[0]) @ across.T
    inner = np.histogram2d(*places.T, bins=30, range=[[-1.5, 1.5]] * 2)[0]
    whole = meets.reshape(601, 601).T[:600, :600].reshape(30, 20, 30, 20).all(axis=(1, 3))
    expected = len(points) * 0.01 / area
    assert np.abs(inner[whole] - expected).max() < 5.0 * math.sqrt(expected) and whole.sum() > 30


@jit
def _through_middle(boxes, points, d, out):
    for i in range(len(out)):
        meets, at, area = meets_middle(boxes, 0, vec3(points[i]), vec3(d))
        out[i, 0], out[i, 4] = f32(1) if meets else f32(0), area
        for c in range(3):
            out[i, 1 + c] = at[c]


def test_lines_cross_the_middle_of_a_box_where_its_other_axes_say():
    box, d = turned_box(), np.array((0.48, 0.6, 0.64), f32)
    wide, axes = box.lengths[0, 1:], box.axes[0, 1:]
    at = box.middles[0] + np.random.default_rng(4).uniform(-1.3, 1.3, (500, 2)) * wide @ axes
    points, out = (at + 2.0 * d).astype(f32), np.empty((len(at), 5), f32)
    _through_middle(box, points, d, out)
    within = (np.abs((at - box.middles[0]) @ axes.T) <= wide).all(axis=1)
    assert (out[:, 0] == within).all() and 0.4 < within.mean() < 0.8
    assert out[:, 1:4] == pytest.approx(at, abs=1e-5)
    assert out[:, 4] == pytest.approx(4.0 * 0.7 * 0.4 * abs(float(d @ box.axes[0, 0])))
    _through_middle(box, points, box.axes[0, 1], out)
    assert not out[:, 0].any()


def test_boxes_hold_what_lines_their_openings_outside():
    """A sill half as deep as the opening is wide, but not what is in the room, nor the ground far below."""
    box, random = turned_box(lengths=(0.01, 0.6, 0.5)), np.random.default_rng(5)
    sill = np.column_stack(
        [random.uniform(0.0, 0.5, 200), np.full(200, -0.62), random.uniform(-0.5, 0.5, 200)]
    )
    far = random.uniform((-2.0, -9.0, -0.5), (0.0, 0.5, 0.5), (200, 3))
    ground = random.uniform((0.0, -9.0, -0.5), (9.0, -1.0, 0.5), (200, 3))
    points = box.middles[0] + np.concatenate([sill, far, ground]) @ box.axes[0]
    lined = lined_boxes(box, np.concatenate([points, np.full((9, 3), np.nan)]).astype(f32))
    local = (points - lined.middles[0]) @ lined.axes[0].T
    assert (np.abs(local[:200]) <= lined.lengths[0]).all()
    assert lined.lengths[0] == pytest.approx((0.25, 0.62, 0.5), abs=0.05)


def lines_through(windows, count=400, seed=3):
    """Lines from a room's floor through windows in the wall at x = 2.5, each (z, y, half width, half height),
    and what `fit_boxes` is told: the wall's plane beside each, 3 m away at the nearest."""
    random = np.random.default_rng(seed)
    starts = random.uniform((-2.0, 0.0, -2.0), (1.5, 0.4, 2.0), (count, 3))
    z, y, wide, high = np.array(windows)[random.integers(len(windows), size=count)].T
    u, v = random.uniform(-1.0, 1.0, (2, count))
    through = np.stack([np.full(count, 2.5), y + v * high, z + u * wide], axis=1)
    way = through - starts
    along = np.linalg.norm(way, axis=1)
    planes = np.full((count, 4, 4), np.nan)
    planes[:, 1] = -1.0, 0.0, 0.0, -2.5
    planes[::3, 2] = 0.0, 1.0, 0.0, 0.0  # others have the floor beside them, too
    told = starts, way / along[:, None], along * random.uniform(0.6, 1.3, count), 1.3 * along, planes
    return tuple(each.astype(f32) for each in told)


def test_lines_through_windows_have_a_box_for_each():
    """As large as the window to a tenth, whatever is told of how far its border is; each explains its own."""
    windows = [(-1.2, 1.4, 0.4, 0.6), (0.9, 1.5, 0.7, 0.5)]
    boxes, shares = fit_boxes(*lines_through(windows))
    best = np.argsort(-shares.mean(axis=0))[:2]
    assert shares.mean(axis=0)[best].sum() > 0.98
    for z, y, wide, high in windows:
        k = min(best, key=lambda k: abs(boxes.middles[k, 2] - z))
        assert boxes.middles[k] == pytest.approx((2.5, y, z), abs=0.05)
        reach = boxes.lengths[k] @ np.abs(boxes.axes[k])
        assert reach[1:] == pytest.approx((high, wide), rel=0.1) and reach[0] < 0.05
        assert (reach[1:] > (high - 0.01, wide - 0.01)).all()


def test_lines_that_have_no_plane_in_common_have_boxes_about_points_beside_them():
    """As among leaves: every line passes one."""
    *told, planes = lines_through([(0.0, 1.4, 0.5, 0.5)])
    planes[:] = np.nan
    boxes, shares = fit_boxes(*told, planes)
    pdf = np.zeros(len(shares))
    for k in range(len(boxes.middles)):
        alone, found = Boxes(*(each[k : k + 1] for each in boxes)), np.empty(1, f32)
        for i, (start, d) in enumerate(zip(told[0], told[1], strict=True)):
            _pdfs(alone, start, d[None], found)
            pdf[i] += found[0]
    assert (pdf > 0.0).all() and shares.sum(axis=1) == pytest.approx(np.ones(len(shares)))


def test_cells_draw_from_boxes_as_lines_near_them_do_and_a_little_from_all():
    shares = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    weights = cell_weights(shares, np.array([[0, 1], [1, 2], [2, 3]]))
    assert weights == pytest.approx(np.array([[0.95, 0.05], [0.5, 0.5], [0.05, 0.95]]))


def test_upright_boxes_have_the_corners_that_were_given():
    corners = np.array([[[0.0, 1.0, -2.0], [2.0, 1.0, 4.0]]])
    boxes = joined_boxes([NO_BOXES, upright_boxes(corners)])
    assert boxes.middles == pytest.approx(np.array([[1.0, 1.0, 1.0]]))
    assert boxes.lengths == pytest.approx(np.array([[1.0, 0.0, 3.0]]))


def test_boxes_about_one_opening_share_by_their_areas():
    """Of a slot of 2 x 6 m one box is about a half of 2 x 3, as most lines pass it, and one about all; a
    third, across, is alone, and one in the slot's plane without lines stays without."""
    corners = np.array([
        [(-1, 3.9, 0), (1, 4.1, 3)],
        [(-1, 3.9, -3), (1, 4.1, 3)],
        [(1, 0, -3), (1.1, 4, 3)],
        [(-1, 4, 0), (1, 4, 2)],
    ])  # fmt: skip
    boxes = upright_boxes(corners)
    outward = np.array([(1, 2, 0), (1, 2, 0), (0, 1, 2), (1, 2, 0)])
    boxes = boxes._replace(
        axes=np.take_along_axis(boxes.axes, outward[..., None], axis=1),
        lengths=np.take_along_axis(boxes.lengths, outward, axis=1),
    )
    assert even_shares(boxes, np.array([0.85, 0.05, 0.1, 0.0])) == pytest.approx([0.3, 0.6, 0.1, 0.0])
