"""Blended surfaces show what lies behind them by as much as they are clear, without grain."""

import numpy as np
import pytest
from transport import Tracer

import ispm
from ispm.library.common import lambert
from ispm.library.shapes import box, polygons
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight, SpotLight
from ispm.scene.material import AlphaMode, Material, Texture
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

WALL, PANEL = (0.7, 0.5, 0.2), (0.2, 0.4, 0.8)
CORNERS = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)


def blended(opacity, **fields):
    return Material((*PANEL, opacity), alpha_mode=AlphaMode.BLEND, double_sided=True, **fields)


def layers(count):
    """Squares one before the other, in one mesh."""
    return polygons([CORNERS + np.array((0.0, 0.0, 0.1 * k)) for k in range(count)])


def scene_of(*panels, wall=None):
    """A wall of 8 x 8 m, panels (mesh, material, z) before it, a lamp whose shadows of them fall aside."""
    scene = Scene()
    if wall is not False:
        scene.add(polygons([4.0 * CORNERS]), material=wall or lambert(WALL))
    for mesh, material, z in panels:
        scene.add(mesh, material=material, translation=(0.0, 0.0, z))
    scene.add(PointLight((90.0, 80.0, 70.0)), translation=(3.5, 3.5, 2.0))
    scene.add(Camera(), translation=(0.0, 0.0, 6.0))
    return scene


def seen(scene, **settings):
    """Radiance of the middle of the picture, in which the panels are before the wall's lit part."""
    frame = ispm.render(scene, size="48x48", bounces=0, antialias=False, **settings)
    return frame.radiance[20:28, 20:28, :3]


@pytest.mark.parametrize("opacity", [0.0, 0.25, 0.9, 1.0])
@pytest.mark.parametrize("unlit", [False, True])
def test_a_layer_and_what_is_behind_add_by_its_opacity(opacity, unlit):
    """Exactly in one pass: what binary16 of the G-buffer rounds, twice, and shadow rays' 1e-4."""
    whole = Material(PANEL, double_sided=True, roughness=0.7, unlit=unlit)
    panel = seen(scene_of((layers(1), whole, 1.0), wall=False))
    wall = seen(scene_of())
    both = seen(scene_of((layers(1), blended(opacity, roughness=0.7, unlit=unlit), 1.0)))
    assert both == pytest.approx(opacity * panel + (1 - opacity) * wall, rel=2e-3)


@pytest.mark.parametrize("size", ["48x48", "47x47"])
@pytest.mark.parametrize("turn", [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75])
def test_pixels_on_the_edge_of_two_triangles_show_one_layer(turn, size):
    """Of squares whose diagonal, turned by multiples of pi / 4, runs through the pixels' centers."""
    mesh, found = layers(1), []
    for triangles in (mesh.triangles, mesh.triangles[::-1], np.roll(mesh.triangles, 1, axis=1)):
        scene = scene_of(wall=Material((1.0, 1.0, 1.0), unlit=True))
        panel = ispm.Mesh(mesh.positions, triangles)
        rotation = ispm.axis_angle((0.0, 0.0, 1.0), turn * np.pi)
        scene.add(panel, material=blended(0.25, unlit=True), translation=(0, 0, 1.3), rotation=rotation)
        found.append(ispm.render(scene, size=size, bounces=0, antialias=False).radiance[18:30, 18:30])
    expected = 0.75 + 0.25 * np.array(PANEL)
    assert np.stack(found) == pytest.approx(np.broadcast_to(expected, (3, 12, 12, 3)), rel=2e-3)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("as_nodes", [False, True])
def test_layers_one_behind_the_other_let_their_product_through(count, as_nodes):
    """Of emission alone, so that no shadow counts; what is seen by a third layer is a draw, of 64 pixels."""
    wall, fields = Material((1.0, 1.0, 1.0), unlit=True), {"unlit": True}
    each = [(layers(1), blended(0.5, **fields), 1.0 + 0.1 * k) for k in range(count)]
    panels = each if as_nodes else [(layers(count), blended(0.5, **fields), 1.0)]
    found = seen(scene_of(*panels, wall=wall), passes=1 if count == 2 else 16)
    clear = 0.5**count
    expected = clear + (1 - clear) * np.array(PANEL)
    # at worst a quarter of the picture is a draw between the two colors: 4.5 standard errors of 64 x 16 such
    near = 2e-3 if count == 2 else 4.5 * 0.25 * 0.5 * 0.8 / 32.0
    assert found.mean(axis=(0, 1)) == pytest.approx(expected, rel=2e-3, abs=near)
    if count == 2:
        assert found == pytest.approx(np.broadcast_to(expected, found.shape), rel=2e-3)


def test_a_decal_in_the_plane_of_its_wall_lets_nothing_behind_the_wall_through():
    """Which of the two a pixel shows the rasteriser decides; behind the decal is the wall."""
    wall = Material((1.0, 1.0, 1.0), unlit=True, double_sided=True)
    beyond = Material((0.0, 0.0, 1.0), unlit=True)
    panels = [(layers(1), blended(0.5, unlit=True), 0.0), (polygons([4.0 * CORNERS]), beyond, -1.0)]
    found = seen(scene_of(*panels, wall=wall))
    shown = np.stack([np.ones(3), 0.5 + 0.5 * np.array(PANEL)])
    assert abs(found[..., None, :] - shown).max(axis=-1).min(axis=-1).max() < 2e-3


def test_a_pattern_of_opacity_shows_the_wall_in_its_holes():
    """Texels of opacity 0 and 1, magnified: each pixel away from their borders shows one or the other."""
    texels = np.full((2, 2, 4), 255, np.uint8)
    texels[[0, 1], [0, 1], 3] = 0
    pattern = Texture(texels, linear=False, mipmaps=False)
    mesh = polygons([CORNERS])
    mesh.uv0 = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    leaf = Material(base_color_texture=pattern, alpha_mode=AlphaMode.BLEND, unlit=True)
    wall = Material((0.0, 1.0, 0.0), unlit=True)
    found = seen(scene_of((mesh, leaf, 1.0), wall=wall))
    colors = np.array([(1.0, 1.0, 1.0), (0.0, 1.0, 0.0)])
    assert abs(found[..., None, :] - colors).max(axis=-1).min(axis=-1).max() < 2e-3
    assert 0.4 < (found[..., 0] > 0.5).mean() < 0.6


def test_what_is_behind_is_background_where_nothing_stands():
    """A layer before a colored background shows it, and the background's own light where there is a sky."""
    panel = layers(1), blended(0.25, unlit=True), 1.0
    found = ispm.render(
        scene_of(panel, wall=False), size="48x48", bounces=0, antialias=False, background=(0.0, 1.0, 0.0)
    )
    expected = 0.25 * np.array(PANEL) + 0.75 * np.array((0.0, 1.0, 0.0))
    assert found.radiance[20:28, 20:28, :3] == pytest.approx(np.broadcast_to(expected, (8, 8, 3)), rel=2e-3)


@pytest.mark.parametrize("preset", ["default", "fast"])
@pytest.mark.parametrize("opacity", [0.25, 0.5])
def test_indirect_light_of_a_layer_is_by_its_opacity(preset, opacity):
    """A small card that a lit wall alone lights. Photons meet it with the chance of its opacity, by which
    what it shows counts once more: it had a fourth of its light at .25, and half of it at .5. A mean of four
    passes is uncertain by up to 4 %."""
    found = []
    for share in (1.0, opacity):
        scene = Scene()
        scene.add(polygons([4.0 * CORNERS]), material=lambert((0.8,) * 3))
        card = Material((0.6, 0.6, 0.6, share), alpha_mode=AlphaMode.BLEND, double_sided=True, specular=0.0)
        scene.add(polygons([0.2 * CORNERS]), material=card, translation=(0.0, 0.0, 1.0))
        lamp = scene.add(SpotLight((60.0,) * 3, outer_angle=0.5), translation=(1.5, 1.5, 1.5))
        lamp.look_at((1.0, 1.0, 0.0))
        camera = Camera.look_at((-0.3, -0.3, 0.2), (0.0, 0.0, 1.0))
        settings = ispm.Settings(size=(48, 48), preset=preset, photons=400_000, antialias=False)
        with ispm.Renderer(scene, settings, camera) as renderer:
            *_, frame = renderer.converge(4)
        found.append(frame.indirect[22:26, 22:26].mean())
    assert found[1] == pytest.approx(opacity * found[0], rel=0.12)


def test_a_faint_sheet_close_above_a_floor_makes_no_light(gpu):
    """Photons of both lay in each other's kernels: with those that meet a sheet counted by the inverse of its
    opacity, a floor lit by its ceiling was .7 too bright with one a millimetre above. Paths and four passes
    are uncertain by 1 %."""
    scene = Scene()
    for low, high in (
        ((-2, -0.1, -2), (2, 0, 2)), ((-2.1, 0, -2), (-2, 2, 2)), ((2, 0, -2), (2.1, 2, 2)),
        ((-2, 0, -2.1), (2, 2, -2)), ((-2, 2, -2), (2, 2.1, 2)),
    ):  # fmt: skip
        scene.add(box(low, high), material=lambert((0.6,) * 3))
    both = dict(alpha_mode=AlphaMode.BLEND, specular=0.0, double_sided=True)
    corners = np.array([(-2, 0.001, 2), (2, 0.001, 2), (2, 0.001, -2), (-2, 0.001, -2)], float)
    scene.add(polygons([corners]), material=Material((0.6, 0.6, 0.6, 0.15), **both))
    lamp = scene.add(SpotLight((60.0,) * 3, outer_angle=0.8), translation=(0.0, 0.3, 0.0))
    lamp.look_at((0.0, 2.0, 0.0001))
    camera, size, floor = Camera.look_at((0.0, 1.2, 1.9), (0.0, 0.4, -1.0)), (64, 48), slice(-16, None)
    origins, directions = CameraView(size, camera.pose, camera.yfov, None).rays()
    rays = np.broadcast_to(origins, directions.shape)[floor].reshape(-1, 3), directions[floor].reshape(-1, 3)
    tracer = Tracer(scene)
    expected = path_light(tracer.tables, *rays, samples=range(128), bounces=8, threads=2).mean()
    settings = ispm.Settings(size=size, bounces=8, antialias=False)
    with ispm.Renderer(scene, settings, camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(4)
    assert frame.radiance[floor].mean() == pytest.approx(expected, rel=0.05)
