"""Wide soft shadows in one pass: as smooth as many rays make them, and right in the mean."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance
from rgbe import direction_of, seen_along

from ispm import (
    Camera,
    Environment,
    Material,
    RectLight,
    Renderer,
    Scene,
    Settings,
    Texture,
    euler,
    shapes,
)
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box, polygons
from ispm.stages.camera import CameraView

SIZE = 128, 96
HEIGHT = 3.0  # m, of the wall
RAYS = 16 * 9  # squares of 4 x 4 pixels, of which the filter takes 3 x 3 at least


def wall_over_floor(eye, target):
    """A floor, and a black wall without end along x at z = 0, in a uniform environment."""
    scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32)))
    scene.add(shapes.plane(400, 400), material=lambert((0.5,) * 3))
    scene.add(box((-300, -1, -1), (300, HEIGHT, 0)), material=lambert((0.0,) * 3))
    add_camera(scene, eye, target, math.radians(20))
    return scene


def shaded_share(scene):
    """(h, w) share of the floor's irradiance that the wall takes away: the form factor of a long strip."""
    camera = scene.default_camera(SIZE)
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = view.rays_through(x.ravel(), y.ravel())
    z = (origin - d * (origin[:, 1:2] / d[:, 1:2]))[:, 2].reshape(SIZE[::-1])
    return (1.0 - z / np.hypot(z, HEIGHT)) / 2.0


@pytest.mark.parametrize("seed", [0, 1])
def test_one_pass_is_as_smooth_as_a_ray_from_each_of_nine_squares(gpu, seed):
    scene = wall_over_floor((0.0, 8.0, 1.5), (0.0, 0.0, 1.6))
    shaded = shaded_share(scene)
    with Renderer(scene, Settings(size=SIZE, bounces=0, light="none", seed=seed), gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1]
    error = found / (0.5 * (1.0 - shaded)) - 1.0
    # of rays that hit or miss independently; those of a square are spread evenly, and do better
    each = np.sqrt(shaded / (1.0 - shaded) / RAYS)
    assert error.std() < each.mean()
    assert abs(error.mean()) < 4.5 * each.mean() / math.sqrt(error.size / RAYS)


@pytest.mark.parametrize("seed", [0, 1])
def test_rows_of_pixels_along_the_foot_of_a_wall_are_right_in_one_pass(gpu, seed):
    """There the filter takes in less than whole squares, and pixels that draw four times beside others that
    draw once. Five rows' means, of draws from three rows of pixels each, are as near to the truth as means of
    so many independent ones. Where a row drew from one of four rows of parts it was .3 too bright."""
    scene = wall_over_floor((0.0, 16.0, 8.0), (0.0, 0.0, 2.0))
    shaded = shaded_share(scene)
    with Renderer(scene, Settings(size=SIZE, bounces=0, light="none", seed=seed), gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1]
    row = np.flatnonzero(found.min(axis=1) > 0.0)[0] + 1  # the first shows some of the wall
    rows = slice(row, row + 5)
    error = (found / (0.5 * (1.0 - shaded)) - 1.0)[rows].mean(axis=1)
    each = np.sqrt(shaded / (1.0 - shaded) / (3 * SIZE[0]))[rows].mean(axis=1)
    assert math.sqrt(((error / each) ** 2).mean()) < 1.0


HALF_PIT = 2.0  # m, of its side; its walls are as high as the other


def pit():
    """A square pit with black walls in a uniform environment, seen from high above."""
    scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32)))
    scene.add(shapes.plane(400, 400), material=lambert((0.5,) * 3))
    wall = box((HALF_PIT, 0, -3), (HALF_PIT + 1, HEIGHT, 3))
    for turn in range(4):
        turned = euler(0, 90 * turn, 0, degrees=True)
        scene.add(wall, material=lambert((0.0,) * 3), rotation=turned)
    add_camera(scene, (0.0, 30.0, 0.001), (0.0, 0.0, 0.0), math.radians(7.5))
    return scene


def seen_from_the_pit(scene):
    """(n,) which pixels show the pit's floor but for its rim, and of these the share of the sky's light."""
    camera = scene.default_camera(SIZE)
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = view.rays_through(x.ravel(), y.ravel())
    places = origin - d * (origin[:, 1:2] / d[:, 1:2])
    inside = np.abs(places[:, [0, 2]]).max(axis=1) < 0.95 * HALF_PIT
    corners = np.array(
        [(HALF_PIT * i, HEIGHT, HALF_PIT * j) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    up = np.array([0.0, 1.0, 0.0])
    seen = np.array([abs(polygon_irradiance(corners, p, up)) for p in places[inside]]) / math.pi
    return inside, seen


@pytest.mark.parametrize("beside", ["nothing", "a small lamp"])
def test_sharp_shadows_do_not_narrow_what_the_shadows_of_far_walls_are_filtered_over(gpu, beside):
    """As smooth as a ray from each of 36 squares, of the 81 that the filter's widest reach takes in: by the
    nearest of what casts shadows about a pixel it was so many as of 24; by the lamp, which lights none of the
    floor and would have penumbrae of less than a pixel, of 1."""
    scene = pit()
    if beside == "a small lamp":
        lamp = RectLight((1e4,) * 3, width=0.3, height=0.3)
        scene.add(lamp, translation=(30.0, 20.0, 0.0)).look_at((0.0, 0.0, 0.0))
    inside, seen = seen_from_the_pit(scene)
    errors = []
    for seed in range(3):
        settings = Settings(size=SIZE, bounces=0, light="none", seed=seed)
        with Renderer(scene, settings, gpu=gpu) as renderer:
            errors.append(renderer.render().direct[..., 1].ravel()[inside] / (0.5 * seen) - 1.0)
    each = np.sqrt((1.0 - seen) / seen / (16 * 36))
    assert np.std(errors) < each.mean()


def lamps_over_floor():
    """A floor, and four panels 3 m above it, of which one is much brighter: none casts a shadow."""
    scene, panels = Scene(), []
    scene.add(shapes.plane(20.0, 20.0), material=lambert((0.5,) * 3))
    for x, luminance in ((-2.4, 10.0), (-0.8, 10.0), (0.8, 60.0), (2.4, 10.0)):
        panel = RectLight((luminance,) * 3, width=0.2, height=1.5)
        scene.add(panel, translation=(x, 3.0, 0.0), rotation=euler(-90, 0, 0, degrees=True))
        corners = [(x + 0.1 * i, 3.0, 0.75 * j) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        panels.append((luminance, np.array(corners)))
    return scene, panels


@pytest.mark.parametrize("seed", [0, 1])
def test_light_that_nothing_shades_has_hardly_any_grain_in_one_pass(gpu, seed):
    """The filter takes in what lies within .09 of the panels' distance d, over which light that falls off as
    (1 + (x / d)^2)^-2 bends by 2 / 3 .09^2, half a hundredth. 25 draws err by .013 here, and 9 times as many
    by a third of it."""
    scene, panels = lamps_over_floor()
    camera = Camera.look_at((0.0, 2.5, 3.0), (0.0, 0.0, 0.0), yfov=0.2)
    with Renderer(scene, Settings(size=SIZE, bounces=0, seed=seed), camera, gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1].ravel().astype(float)
    view = CameraView(SIZE, camera.pose, camera.yfov, None)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, d = view.rays_through(x.ravel(), y.ravel())
    places = origin - d * (origin[:, 1:2] / d[:, 1:2])
    some = slice(None, None, 7)
    up = np.array([0.0, 1.0, 0.0])
    exact = [sum(e * polygon_irradiance(c, p, up) for e, c in panels) for p in places[some]]
    error = found[some] / (0.5 / math.pi * np.array(exact)) - 1.0
    bend = 2 / 3 * 0.09**2
    assert error.std() < math.hypot(bend, 0.013 / 3)
    assert abs(error.mean()) < bend


EDGE, ABOVE, HALF = 0.027, 2.0, 0.2  # m: heights of an edge and of a lamp, and half of its side
PIXEL = 0.001  # m


def edge_over_floor(environment=None):
    """A floor, a sheet close above it that ends at x = 0, and a square lamp: a penumbra of some 4 pixels."""
    scene = Scene(environment=environment)
    scene.add(shapes.plane(40.0, 40.0), material=lambert((0.5,) * 3))
    sheet = shapes.plane(2.0, 2.0)
    scene.add(sheet, material=lambert((0.0,) * 3), translation=(-1.0, EDGE, 0.0))
    lamp = RectLight((10.0,) * 3, width=2 * HALF, height=2 * HALF)
    scene.add(lamp, translation=(0.0, ABOVE, 0.0), rotation=euler(-90, 0, 0, degrees=True), name="lamp")
    pose = Camera.look_at((3.0, 3.0, 0.0), (0.0, 0.0, 0.0)).pose
    return scene, Camera(pose=pose, ymag=SIZE[1] * PIXEL / 2)


def beneath_the_edge(camera):
    """Rows of the picture that show the floor about the edge's shadow, the light in their middles, and the
    shares of the lamp that are seen from there."""
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    rows = np.arange(SIZE[1])
    origin, d = view.rays_through(np.full(SIZE[1], SIZE[0] / 2), rows + 0.5)
    x = (origin - d * (origin[:, 1:2] / d[:, 1:2]))[:, 0]
    rows = rows[np.abs(x) < 16 * PIXEL]
    light, shares = [], []
    for place in x[rows]:
        begins = min(max(place - place * ABOVE / EDGE, -HALF), HALF)
        corners = [(i, ABOVE, HALF * j) for i, j in ((begins, -1), (HALF, -1), (HALF, 1), (begins, 1))]
        seen = polygon_irradiance(np.array(corners), np.array([place, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
        light.append(0.5 / math.pi * 10.0 * seen)
        shares.append((HALF - begins) / (2 * HALF))
    return rows, np.array(light), np.array(shares)


@pytest.mark.parametrize("beside", ["nothing", "a dim sky"])
def test_a_narrow_penumbra_is_right_in_the_mean_sharp_and_smooth_in_one_pass(gpu, beside):
    """Four draws a pixel, which hit or miss: their mean over the penumbra is known to half over the root of
    their number at most, and lies within four times that (6e-5 by chance). Were a pixel to draw again by what
    its own draw met, it would be off by an eighth. The filter takes in a quarter of the penumbra's width to
    each side, three rows, which blur it by what their mean differs from the middle one; of four times a
    row's own noise beside. Along a row a mean of 9 pixels, 36 draws, deviates by sqrt(p (1 - p) / 36), and
    those of parts of a square by less."""
    sky = Environment(np.full((4, 8, 3), 1e-5, np.float32)) if beside == "a dim sky" else None
    scene, camera = edge_over_floor(sky)
    rows, exact, shares = beneath_the_edge(camera)
    found = []
    for seed in range(8):
        with Renderer(
            scene, Settings(size=SIZE, bounces=0, antialias=False, seed=seed), camera, gpu=gpu
        ) as r:
            found.append(r.render().direct[rows, :, 1].astype(float))
    found = np.array(found)
    half = (shares > 0.0) & (shares < 1.0)
    lit = exact.max()
    draws = 4 * SIZE[0] * len(found)
    error = (found.mean(axis=(0, 2)) - exact)[1:-1] / lit
    assert abs(error.sum() / half.sum()) < 4.0 * 0.5 / math.sqrt(draws * half.sum())
    blur = np.abs(np.convolve(exact, np.full(3, 1 / 3), "valid") - exact[1:-1]) / lit
    assert (np.abs(error) < blur + 4.0 * 0.5 / math.sqrt(draws)).all()
    grain = found.std(axis=2).mean(axis=0)[half] / lit
    assert grain.mean() < np.sqrt(shares * (1.0 - shares) / 36)[half].mean()


@pytest.mark.parametrize("pieces", ["two lamps", "one of two pieces"])
def test_a_sharp_shadow_of_one_of_two_lamps_is_smooth_in_one_pass(gpu, pieces):
    """A share p of the draws there goes to the other lamp: means of 25 pixels of four deviate by
    sqrt(p (1 - p) / 100) of what both bring, those of parts of a square by less, single pixels by five times
    that."""
    scene, camera = edge_over_floor()
    if pieces == "two lamps":
        lamp = RectLight((2.0,) * 3, width=2 * HALF, height=2 * HALF)
        scene.add(lamp, translation=(2.0, ABOVE, 0.0), rotation=euler(-90, 0, 0, degrees=True))
    else:
        scene.remove("lamp")
        corners = HALF * np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)])
        squares = [corners + np.array((x, ABOVE, 0.0)) for x in (0.0, 2.5)]
        scene.add(polygons(squares), material=Material((0.0,) * 3, specular=0.0, emission=(10.0,) * 3))
    rows, _, _ = beneath_the_edge(camera)
    with Renderer(scene, Settings(size=SIZE, bounces=0, antialias=False), camera, gpu=gpu) as renderer:
        found = renderer.render().direct[rows, :, 1].astype(float)
    both, one = found[-4:].mean(), found[:4]
    share = one.mean() / both
    assert 0.01 < share < 0.2
    assert one.std(axis=1).mean() < math.sqrt(share * (1.0 - share) / 100) * both


@pytest.mark.parametrize("light", ["sky", "lamp"])
def test_a_floor_of_ten_kilometres_does_not_shade_itself(gpu, light):
    """Rays started above the floor by less than what rounding makes of where they meet so large a triangle:
    more than a tenth of a sky's light was lost. Beside a floor of 10 m all draws are the same, but for the
    few that pass the box's edges by less than rays start higher, a thousandth of the distance to the eye."""
    shown = []
    for size in (10.0, 1e4):
        scene = Scene(environment=Environment(np.ones((4, 8, 3), np.float32))) if light == "sky" else Scene()
        if light == "lamp":
            lamp = RectLight((10.0,) * 3, width=1.0, height=1.0)
            scene.add(lamp, translation=(0.0, 3.0, 0.0), rotation=euler(-90, 0, 0, degrees=True))
        scene.add(shapes.plane(size, size), material=lambert((0.5,) * 3), translation=(0.37, 0.0, 0.21))
        scene.add(box((-0.5, 0.2, -0.3), (0.5, 1.2, 0.0)), material=lambert((0.5,) * 3))
        camera = Camera.look_at((0.0, 0.9, 1.5), (0.0, 0.0, 0.1), yfov=0.6)
        with Renderer(scene, Settings(size=SIZE, bounces=0, light="none"), camera, gpu=gpu) as renderer:
            shown.append(renderer.render().direct[60:, :, 1].astype(float))
    small, large = shown
    assert small.min() > 0.0
    off = np.abs(large / small - 1.0)
    assert off.mean() < 1e-3


SUN, PARTS = 64, 16  # rows of an image above its suns' middles; of its pixels along each side
CROSSED = 0.025  # m, height of an edge: a penumbra of some pixel


def sun_over_an_edge():
    """A floor, a sheet above it that ends at x = 0, and a sun alone in a black sky, at (-1, 1, 0)."""
    image = np.zeros((4 * SUN, 8 * SUN, 3), np.float32)
    image[SUN - 1 : SUN + 1, 2 * SUN - 1 : 2 * SUN + 1] = 1e5
    scene = Scene(environment=Environment(image))
    scene.add(shapes.plane(40.0, 40.0), material=lambert((0.5,) * 3))
    scene.add(shapes.plane(2.0, 2.0), material=lambert((0.0,) * 3), translation=(-1.0, CROSSED, 0.0))
    pose = Camera.look_at((3.0 + CROSSED, 3.0, 0.0), (CROSSED, 0.0, 0.0)).pose
    return scene, image, Camera(pose=pose, ymag=SIZE[1] * PIXEL / 2)


def parts_of_the_sun(image):
    """Directions, (n, 3), of parts of pixels about the sun, the light, lx, that each brings to the floor, and
    the greatest of its pixel, as which all parts of that are drawn."""
    near = (np.arange(-3 * PARTS, 3 * PARTS) + 0.5) / PARTS
    y, x = np.meshgrid(SUN + near, 2 * SUN + near, indexing="ij")
    directions = direction_of(x, y, (8 * SUN, 4 * SUN))
    light = seen_along(image, directions)[..., 1] * np.maximum(directions[..., 1], 0.0)
    light *= np.sin(np.pi * y / (4 * SUN)) * (np.pi / (4 * SUN * PARTS)) ** 2
    blocks = light.reshape(6, PARTS, 6, PARTS)
    greatest = np.broadcast_to(blocks.max(axis=(1, 3), keepdims=True), blocks.shape).reshape(light.shape)
    return directions.reshape(-1, 3), light.ravel(), greatest.ravel()


def test_the_edge_of_a_suns_shadow_is_sharp_and_has_no_specks_in_one_pass(gpu):
    """Four draws a pixel, as good as `even` times as many of a sun whose parts are drawn by what each brings.

    The share that passes is a ratio of their sums: it is off by the product of its deviation and of that of
    the divisor over its mean at most (Hartley and Ross, Unbiased Ratio Estimators, Nature 174, 1954), and by
    .5 %, as the light without shadows is. A row's own noise lies within four deviations but for 6e-5. Where
    the filter took in two pixels to each side, rows beside the edge were off by .3.
    No pixel is brighter than what nothing shades. One of the lit rows whose draws bring nothing is as those
    about it, of which three of five rows are lit.
    """
    scene, image, camera = sun_over_an_edge()
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)
    rows = np.arange(SIZE[1])
    origin, d = view.rays_through(np.full(SIZE[1], SIZE[0] / 2), rows + 0.5)
    x = (origin - d * (origin[:, 1:2] / d[:, 1:2]))[:, 0]
    directions, light, greatest = parts_of_the_sun(image)
    crossing = x[:, None] + CROSSED * (directions[:, 0] / np.maximum(directions[:, 1], 1e-9))
    exact = (light * (crossing > 0.0)).sum(axis=1) / light.sum()
    found = []
    for seed in range(8):
        settings = Settings(size=SIZE, bounces=0, antialias=False, seed=seed)
        with Renderer(scene, settings, camera, gpu=gpu) as renderer:
            found.append(renderer.render().direct[..., 1].astype(float) / (0.5 / math.pi * light.sum()))
    found = np.array(found)
    some = greatest > 0.0
    even = light.sum() ** 2 / (greatest.sum() * (light[some] ** 2 / greatest[some]).sum())
    deviation = np.sqrt(exact * (1.0 - exact) / (4 * even))
    bias, noise = deviation * math.sqrt((1.0 / even - 1.0) / 4), deviation / math.sqrt(SIZE[0] * len(found))
    error = found.mean(axis=(0, 2)) - exact
    assert (np.abs(error) < bias + 4.0 * noise + 5e-3).all()
    assert found.max() < 1.005
    assert found[:, exact == 1.0].min() > 0.6


def grainy(gpu, lamp, seed):
    """How many pixels of a long floor differ by a tenth from the median of 5 x 5; a pillar shades a part of
    it, and the lamp stands on its far end."""
    scene, size = Scene(), (192, 96)
    scene.add(box((-4, -0.1, -30), (4, 0, 3)), material=lambert((0.5,) * 3))
    scene.add(box((-3, 0, -12.5), (-2, 3, -12)), material=lambert((0.0,) * 3))
    scene.add(lamp, material=Material((0.0,) * 3, emission=(20.0,) * 3))
    add_camera(scene, (0.2, 1.5, 2.5), (0.0, 0.2, -5.0), math.radians(40))
    with Renderer(scene, Settings(size=size, bounces=0, light="none", seed=seed), gpu=gpu) as renderer:
        found = renderer.render().direct[32:, :, 1]
    squares = np.lib.stride_tricks.sliding_window_view(np.pad(found, 2, mode="edge"), (5, 5))
    median = np.median(squares, axis=(2, 3))
    return np.count_nonzero(abs(found - median) > 0.1 * median)


def test_rays_along_a_floor_do_not_find_it_shaded_by_itself(gpu):
    """Those to the sides of a lamp that stands on it met it by rounding, where they start: as if a shadow
    began there, up to 24 pixels beside each were not filtered."""
    side = polygons([np.array([(-4.0, 0, -30), (4, 0, -30), (4, 3, -30), (-4, 3, -30)])])
    solid = box((-4, 0, -30.1), (4, 3, -30))
    for seed in range(4):
        assert grainy(gpu, solid, seed) <= grainy(gpu, side, seed)


@pytest.mark.parametrize("passes", [1, 4])
def test_light_that_few_draws_bring_leaves_no_dark_pixels(gpu, passes):
    """Of a panel's texture one texel in 64 shines. Where of 5 x 5 pixels none draws from it, what share of
    its light passes is known from those farther off: taken as none, one pixel in nine was black. Of triangles
    as a whole few draws do: the darkest hundredth had .2 of the mean, and .6 since their parts are drawn."""
    texture = np.zeros((8, 8, 3), np.float32)
    texture[3, 4] = 1.0
    panel = polygons([np.array([(-1.0, 3, -1), (1, 3, -1), (1, 3, 1), (-1, 3, 1)])])
    panel.uv0 = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    glow = Material((0.0,) * 3, emission=(50.0,) * 3, emission_texture=Texture(texture))
    scene = Scene()
    scene.add(shapes.plane(20.0, 20.0), material=lambert((0.5,) * 3))
    scene.add(panel, material=glow)
    add_camera(scene, (0.0, 2.5, 4.0), (0.0, 0.0, 0.0), math.radians(40))
    with Renderer(scene, Settings(size=SIZE, bounces=0, light="none"), gpu=gpu) as renderer:
        *_, frame = renderer.converge(passes)
    floor = frame.direct[40:, 20:-20, 1]
    assert np.percentile(floor, 1) > 0.45 * floor.mean()
