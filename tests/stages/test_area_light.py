"""Direct light of skies and large lamps: as smooth in the first pass as may be, and smoother in more."""

import math

import numpy as np
import pytest
from transport import Tracer

from ispm import Camera, Environment, Material, RectLight, Renderer, Settings, Sky, Texture, builtin, shapes
from ispm.library.studio_light import studio_radiance
from ispm.optics.bsdf import Dielectric, eval_bsdf, surface_bsdf
from ispm.optics.bsdf_sampling import pdf_bsdf
from ispm.optics.environment import environment_light
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView


def test_the_first_pass_of_metal_is_filtered_as_others_are(gpu):
    """Metal has no Lambert lobe whose light without shadows would be known: passes 1 and 2 are means of draws
    over the same squares, with errors alike against the mean of 64 more passes. 1,500 pixels are some 60
    squares of 5 x 5, by which each root mean square is known to 1 / sqrt(2 * 60) = 9 %; the bound lies four
    standard deviations of their ratio above 1. A pixel's own draw had four times the error."""
    scene = Scene(environment=Environment(np.random.default_rng(2).random((8, 16, 3)) ** 4))
    scene.add(shapes.plane(20.0, 20.0), material=Material(metallic=1.0, roughness=1.0))
    camera = Camera.look_at((0.0, 3.0, 0.0), (0.0, 0.0, -0.1), yfov=0.6)
    settings = Settings(size=(48, 32), bounces=0, antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        means = [frame.direct.astype(float) for frame in renderer.converge(66)]
    first, second = means[0], 2.0 * means[1] - means[0]
    truth = (66.0 * means[65] - 2.0 * means[1]) / 64.0
    errors = [np.sqrt(((each - truth) ** 2).mean()) for each in (first, second)]
    assert errors[0] < 1.5 * errors[1]


def variance_of_one(environment, material, seen, count):
    """The variance over the square of the mean of what metal on a floor shows along `seen` by one direction,
    drawn by the environment or by its lobe, each in turn, by so many directions that are even all around."""
    scene = Scene(environment=environment)
    scene.add(shapes.plane(1.0, 1.0), material=material)
    table = Tracer(scene).tables.environment
    up, wo = (np.float32(0), np.float32(1), np.float32(0)), tuple(np.float32(v) for v in seen)
    white, alpha = (np.float32(1),) * 3, np.float32(material.roughness**2)
    metallic = np.float32(material.metallic)
    metal = Dielectric(np.float32(0.04), white, np.float32(1), np.float32(1.5), False)
    b = surface_bsdf(white, metallic, np.float32(math.sqrt(alpha)), np.float32(0), metal, True)
    first = second = 0.0
    for u1, u2 in np.random.default_rng(1).random((count, 2)):
        sine = math.sqrt(1.0 - u1 * u1)
        wi = tuple(
            np.float32(v) for v in (sine * math.cos(2 * math.pi * u2), u1, sine * math.sin(2 * math.pi * u2))
        )
        radiance, own = environment_light(table, wi)
        light = u1 * eval_bsdf(b, up, up, wo, wi)[1] * radiance[1]
        density = 0.5 * (own + pdf_bsdf(b, up, wo, wi))
        first, second = first + light, second + light**2 / max(density, 1e-9)
    mean = 2 * math.pi * first / count
    return 2 * math.pi * second / count / mean**2 - 1.0


@pytest.mark.parametrize("metallic", [0.3, 1.0])
@pytest.mark.parametrize("roughness", [0.6, 0.9])
def test_rough_metal_in_the_studio_has_the_grain_of_many_draws(gpu, roughness, metallic):
    """Without a filter a pixel is the mean of eight directions, of which one has a shadow ray: those of a
    lattice are no less even than independent ones. What is in part metal adds its Lambert light, which is
    known. A single one, drawn by the lobe alone, left blotches on balls, over which filters reach a few
    pixels."""
    environment = Environment(studio_radiance())
    material = Material((1.0,) * 3, metallic=metallic, roughness=roughness)
    seen = np.array([0.0, 3.0, 2.0]) / math.sqrt(13.0)
    scene = Scene(environment=environment)
    scene.add(shapes.plane(20.0, 20.0), material=material)
    camera = Camera.look_at(100.0 * seen, (0.0, 0.0, 0.0), yfov=0.01)
    settings = Settings(size=(96, 64), bounces=0, light="none", smoothing=0.01)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        found = renderer.render().direct[..., 1].astype(float)
    alone = variance_of_one(environment, material, seen, 20_000)
    assert found.std() < found.mean() * math.sqrt(alone / 8)


STRIPES = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [1.0, 0.6])
@pytest.mark.parametrize("lit_by", ["lamp", "sky"])
def test_white_beside_saturated_colors_stays_white(gpu, lit_by, roughness, metallic):
    """Stripes of white, red and black, each five pixels wide, that nothing shades: white is as on a white
    floor, whose draws are the same. What passes is a ratio of means over neighbors, of which those that
    reflect nothing in a channel tell as much as others; the rest are roundings of textures, 1 / 255. The
    light of metal was filtered with its color: stripes were blurred over five pixels."""
    camera = Camera.look_at((0.0, 4.0, 0.0), (0.0, 0.0, -1e-3), yfov=0.5)
    settings, shown = Settings(size=(60, 40), bounces=0, antialias=False), []
    for colors in (STRIPES, np.ones((3, 3))):
        scene = Scene(environment=Environment(np.ones((4, 8, 3)))) if lit_by == "sky" else Scene()
        if lit_by == "lamp":
            scene.add(RectLight((10.0,) * 3, width=2.0, height=2.0), translation=(0.0, 6.0, 0.0)).look_at(
                (0, 0, 0)
            )
        image = Texture(np.repeat(colors, 4, axis=0)[None].repeat(4, axis=0), linear=False, mipmaps=False)
        for x in range(-2, 3):
            material = Material(base_color_texture=image, roughness=roughness, metallic=metallic)
            scene.add(shapes.plane(0.75, 3.0), material=material, translation=(0.75 * x, 0.0, 0.0))
        with Renderer(scene, settings, camera, gpu=gpu) as renderer:
            shown.append(renderer.render().direct.astype(float))
    striped, white = shown
    is_white = (striped > 0.5 * white).all(axis=2)
    assert 0.25 < is_white.mean() < 0.4
    assert striped[is_white] == pytest.approx(white[is_white], rel=0.02)


@pytest.mark.parametrize("passes", [1, 8])
def test_a_texture_of_roughness_leaves_no_line_where_eye_paths_end(gpu, passes):
    """Metal that gets rougher from left to right, under an even sky: eye paths find what the smoother half
    reflects, draws what the other does. Columns are means of 100 pixels, whose noise makes neighbors differ
    by 2 % at most; filtered together, the halves had a line of 1.3 beside one of 0.7."""
    ramp = np.zeros((8, 256, 3))
    ramp[..., 1], ramp[..., 2] = np.linspace(0.3, 0.7, 256), 1.0
    scene = Scene(environment=Environment(np.ones((4, 8, 3))))
    texture = Texture(ramp, srgb=False, mipmaps=False)
    metal = Material((0.9,) * 3, metallic=1.0, metallic_roughness_texture=texture)
    scene.add(shapes.plane(4.0, 4.0), material=metal)
    camera = Camera.look_at((0.0, 2.0, 2.0), (0.0, 0.0, 0.0), yfov=0.7)
    settings = Settings(size=(320, 180), bounces=0, antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(passes)
    columns = frame.radiance[40:140, 130:190, 1].mean(axis=0)
    smooth = np.polynomial.Polynomial.fit(np.arange(60.0), columns, 2)(np.arange(60.0))
    assert columns == pytest.approx(smooth, rel=0.06)


def test_passes_in_the_shadow_of_one_lamp_of_two_are_unbiased_and_have_ever_less_noise(gpu):
    """A board hides one of two lamps, whose shadow's edges are sharp: filters are narrow. Which lamp a pixel
    drew in a pass was by chance, so that 8 passes had as much noise as one; and the first pass, which draws
    again where both lights and shadows are near, asked all but the pixel itself, by which it was 6 % too
    bright. Its mean over 6,144 pixels, filtered over 16, is uncertain by 1 %."""
    scene = Scene()
    scene.add(shapes.plane(8.0, 8.0), material=Material((0.6,) * 3, specular=0.0))
    scene.add(shapes.box((1.6, 0.02, 1.6)), translation=(0.0, 0.5, 0.0))
    for x in (-6.0, 0.0):
        lamp = RectLight((900.0,) * 3, width=0.1, height=0.1)
        scene.add(lamp, translation=(x, 3.0, 0.0)).look_at((0.0, 0.0, 0.0))
    camera = Camera.look_at((-0.4, 0.3, 1.5), (-0.4, 0.0, 0.1), yfov=0.1)
    settings = Settings(size=(96, 64), bounces=0, antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        frames = [frame.direct[..., 1].astype(float) for frame in renderer.converge(32)]
    assert frames[0].mean() == pytest.approx(frames[-1].mean(), rel=0.03)
    assert frames[7].std() < 0.8 * frames[0].std()


def test_more_passes_under_a_sky_have_less_noise(gpu):
    """Also two: passes after the first had no filter in narrow penumbrae, and two had 1.6 times the error of
    one. Edges are left out, which only the first pass smooths; the truth is of as many pixels."""
    scene = builtin("cornell-box")
    scene.environment = Sky(sun_elevation=0.5)
    settings = Settings(size=(160, 90), bounces=0, photons=100, antialias=False)
    with Renderer(scene, settings, gpu=gpu) as renderer:
        frames = list(renderer.converge(8))
        renderer.settings = settings.replace(seed=5)
        *_, truth = renderer.converge(64)
    shown = truth.instance
    inner = np.all([np.roll(shown, by, (0, 1)) == shown for by in ((0, 1), (0, -1), (1, 0), (-1, 0))], axis=0)
    away = [np.square(each.direct - truth.direct).mean(axis=2)[inner] for each in frames]
    one, two, _, four, *_, eight = (math.sqrt(each.mean()) for each in away)
    assert two < one and four < 0.9 * one and eight < 0.75 * one


@pytest.mark.parametrize("passes", [1, 4])
def test_a_suns_shadow_holds_the_skys_light_as_smoothly_as_without_the_sun(gpu, passes):
    """Below a box that hides the sun. Filtered as narrowly as the sun's shadow, it had 6 times the noise."""
    image, noise = np.tile(np.linspace(1.0, 0.3, 128)[:, None, None], (1, 256, 3)), []
    for sun in (0.3, 40_000.0):
        image[38:40, 128:130] = sun
        scene = Scene(environment=Environment(image.copy()))
        matte = Material((0.6,) * 3, specular=0.0)
        scene.add(shapes.plane(20.0, 20.0), material=matte)
        scene.add(shapes.box((4.0, 0.2, 4.0)), material=matte, translation=(0.0, 2.0, -1.4))
        camera = Camera.look_at((0.0, 1.2, 0.01), (0.0, 0.0, 0.0), yfov=0.6)
        with Renderer(scene, Settings(size=(96, 96), bounces=0, photons=100), camera, gpu=gpu) as renderer:
            *_, frame = renderer.converge(passes)
        shown = frame.direct.mean(axis=2, dtype=float)
        squares = shown.reshape(12, 8, 12, 8)
        noise.append((squares.std(axis=(1, 3)) / squares.mean(axis=(1, 3))).mean())
    assert noise[1] < 1.5 * noise[0]


def test_passes_of_a_few_parts_make_no_pattern(gpu):
    """Soft shadow on a plane, each pixel over the mean of its 4 x 4: by their places in it, means over 576 of
    them. By chance such a mean is .006 % off, of .15 % that a pixel has in one pass; they were .35 %, which
    shows. Parts that squares draw from in the same turn, one of eight, leave less than .1 %."""
    scene = Scene(environment=Sky(sun_elevation=0.6))
    matte = Material((0.6,) * 3, specular=0.0)
    scene.add(shapes.plane(20.0, 20.0), material=matte)
    scene.add(shapes.box((3.0, 3.0, 3.0)), material=matte, translation=(0.0, 4.0, 0.0))
    camera = Camera.look_at((0.0, 2.0, 0.01), (0.0, 0.0, 0.0), yfov=0.6)
    with Renderer(scene, Settings(size=(96, 96), bounces=0, photons=100), camera, gpu=gpu) as renderer:
        for frame in renderer.converge(8):
            squares = frame.direct.mean(axis=2).reshape(24, 4, 24, 4)
            aside = squares / squares.mean(axis=(1, 3), keepdims=True)
            assert aside.mean(axis=(0, 2)).std() < 1e-3
            assert aside.std() < 2e-3


def test_what_rough_metal_reflects_is_filtered_as_widely_as_soft_shadows(gpu):
    """Nothing shades a floor of metal: its light is a mean over up to 81 squares of 5 x 5 draws. With one
    square the first pass was off by .224 of the light, a root mean square; nine leave a third of that."""
    scene = Scene(environment=Environment(np.random.default_rng(2).random((8, 16, 3)) ** 4))
    metal = Material(metallic=1.0, roughness=0.8)
    scene.add(shapes.plane(20.0, 20.0), material=metal)
    camera = Camera.look_at((0.0, 3.0, 0.0), (0.0, 0.0, -0.1), yfov=0.6)
    settings = Settings(size=(96, 64), bounces=0, antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        first, *_, last = (frame.direct.astype(float) for frame in renderer.converge(64))
    assert np.sqrt(((first / last - 1.0) ** 2).mean()) < 0.224 / 3.0


def test_a_small_lamp_keeps_its_highlight_on_rough_metal(gpu):
    """Filters reach no farther than half a lobe's width, which takes 2 % off its peak in the first pass; 3 %
    more are five standard deviations of a pass's own noise, .6 %. With no limit two thirds were lost."""
    scene = Scene()
    scene.add(shapes.plane(20.0, 20.0), material=Material(metallic=1.0, roughness=0.5))
    glow = Material((0.0,) * 3, specular=0.0, emission=(50.0,) * 3)
    scene.add(
        shapes.plane(0.2, 0.2), material=glow, translation=(0.0, 1.0, -1.5), rotation=(1.0, 0.0, 0.0, 0.0)
    )
    size, camera = (96, 64), Camera.look_at((0.0, 1.5, 1.5), (0.0, 0.0, -0.3), yfov=0.7)
    settings = Settings(size=size, bounces=0, antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        shown = renderer.render().direct[..., 0].astype(float)
    row, column = np.unravel_index(shown.argmax(), shown.shape)
    peak = slice(row - 2, row + 3), slice(column - 2, column + 3)
    view = CameraView(size, camera.pose, camera.yfov, camera.ymag, 1e-3, 100.0)
    x, y = np.arange(size[0]) + 0.5, np.arange(size[1])[:, None] + 0.5
    rays, tracer = [a[peak].reshape(-1, 3) for a in view.rays_through(x, y)], Tracer(scene)
    truth = path_light(tracer.tables, *rays, samples=range(4000), bounces=0, threads=2)
    assert shown[peak].mean() == pytest.approx(truth[:, 0].mean(), rel=0.05)


def test_a_faint_glow_leaves_the_skys_penumbrae_as_smooth_as_they_are(gpu):
    """Small lamps beside a ball, whose light is less than a thousandth of the sky's: their penumbrae are
    narrow, and do not narrow the filter. The sky is drawn by the same numbers, so that light differs by what
    lamps bring. Where the filter reached as far as for lamps it differed by .02."""
    shown = []
    for glow in (0.0, 1.0):
        scene = Scene(environment=Environment(np.ones((4, 8, 3))))
        scene.add(shapes.plane(20.0, 20.0), material=Material((0.5,) * 3, roughness=1.0, specular=0.0))
        scene.add(shapes.sphere(0.5), material=Material((0.5,) * 3), translation=(0.0, 0.7, 0.0))
        for x in (-0.4, 0.4):
            lamp = Material((0.5,) * 3, emission=(glow,) * 3)
            scene.add(shapes.box(0.02), material=lamp, translation=(x, 0.3, 0.0))
        camera = Camera.look_at((0.0, 2.5, 2.5), (0.0, 0.0, 0.6), yfov=0.5)
        with Renderer(
            scene, Settings(size=(96, 64), bounces=0, antialias=False), camera, gpu=gpu
        ) as renderer:
            frame = renderer.render()
            floor = frame.normal[..., 1] > 0.999
            shown.append(frame.direct[..., 1].astype(float))
    dark, lit = (light[floor] for light in shown)
    assert np.sqrt(((lit / dark - 1.0) ** 2).mean()) < 0.005
