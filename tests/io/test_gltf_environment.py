"""EXT_lights_image_based: cube maps of radiance become environments."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import GltfBuilder, quad
from rgbe import hdr, texels_of

from ispm.cli.scene import surround
from ispm.cli.viewpoint import Viewpoint
from ispm.errors import SceneError
from ispm.io import gltf_environment
from ispm.io.gltf_environment import FACES
from ispm.optics.environment import environment_radiance
from ispm.optics.environment_table import environment_power, environment_table
from ispm.optics.vector import LUMINANCE
from ispm.scene.environment import Environment
from ispm.scene.rotation import axis_angle, rotation_matrix
from ispm.scene.scene import Scene

NAME = "EXT_lights_image_based"
SIZE = 16
# The longest component of a direction, and what OpenGL divides by it for a picture's columns (right) and rows
# (down): OpenGL 4.6, table 8.19.
OPENGL = {
    "+X": (0, 1, (2, -1), (1, -1)),
    "-X": (0, -1, (2, 1), (1, -1)),
    "+Y": (1, 1, (0, 1), (2, 1)),
    "-Y": (1, -1, (0, 1), (2, -1)),
    "+Z": (2, 1, (0, 1), (1, -1)),
    "-Z": (2, -1, (0, -1), (1, -1)),
}


def light_from(d: np.ndarray) -> np.ndarray:
    """Radiance, (..., 3) cd/m2, from unit directions (..., 3): smooth, and alike from no two."""
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack([1.0 + 0.6 * x + 0.3 * y, 1.0 + 0.7 * y - 0.2 * z, 1.0 + 0.5 * z * x + 0.2 * z], axis=-1)


def cube(light=light_from, size: int = SIZE) -> np.ndarray:
    """(6, size, size, 3) what `light` shows at the pixels' centers of a cube's faces."""
    place = (np.arange(size) + 0.5) * (2.0 / size) - 1.0
    columns, rows = np.meshgrid(place, place)
    faces = []
    for axis, sign, (s, s_sign), (t, t_sign) in OPENGL.values():
        d = np.empty((size, size, 3))
        d[..., axis], d[..., s], d[..., t] = sign, s_sign * columns, t_sign * rows
        faces.append(light(d / np.linalg.norm(d, axis=-1, keepdims=True)))
    return np.stack(faces)


def rgbd(radiance: np.ndarray, power: float = 2.2) -> np.ndarray:
    """(..., 4) uint8: colors, to the power of 1 / `power`, and by what they are divided."""
    divisor = np.ceil(255.0 / np.maximum(radiance.max(axis=-1, keepdims=True), 1.0)) / 255.0
    divisor = np.minimum(divisor, 255 // np.maximum(radiance.max(axis=-1, keepdims=True), 1.0) / 255.0)
    colors = (radiance * divisor) ** (1.0 / power)
    return np.rint(255.0 * np.concatenate([colors, divisor], axis=-1)).astype(np.uint8)


def coefficients(faces: np.ndarray) -> list[list[float]]:
    """Nine of irradiance, of which the first is right: mean irradiance over its spherical harmonic."""
    size = faces.shape[1]
    place = (np.arange(size) + 0.5) * (2.0 / size) - 1.0
    weights = (1.0 + place[:, None] ** 2 + place**2) ** -1.5
    mean = (faces * weights[..., None]).sum(axis=(0, 1, 2)) / (6.0 * weights.sum())
    return [list(math.pi * mean / math.sqrt(0.25 / math.pi))] + [[0.0, 0.0, 0.0]] * 8


def lit(faces: np.ndarray, coded: np.ndarray | None = None, kind: str = "PNG", **light) -> GltfBuilder:
    """A quad under a cube of these faces."""
    builder = quad(extensionsUsed=[NAME])
    coded = rgbd(faces) if coded is None else coded
    textures = [builder.picture(face, kind) for face in coded]
    images = [builder.json["textures"][texture]["source"] for texture in textures]
    record = {
        "irradianceCoefficients": coefficients(faces),
        "specularImageSize": faces.shape[1],
        "specularImages": [images],
        **light,
    }
    builder.json["extensions"] = {NAME: {"lights": [record]}}
    builder.put("scenes", {"nodes": [0], "extensions": {NAME: {"light": 0}}})
    return builder


def record_of(builder: GltfBuilder) -> dict:
    return builder.json["extensions"][NAME]["lights"][0]


def around(scene: Scene) -> Environment:
    assert isinstance(scene.environment, Environment)
    return scene.environment


def directions(count: int = 400) -> np.ndarray:
    d = np.random.default_rng(5).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def seen(environment: Environment, d: np.ndarray) -> np.ndarray:
    """Radiance, (n, 3), that kernels find in directions (n, 3)."""
    table = environment_table(environment.image)
    found = [environment_radiance(table, tuple(np.float32(each))) for each in d]
    return np.array(found) * environment.intensity


def off(environment: Environment, d: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(seen(environment, d) - expected).max())


# What is lost of radiance of up to 2: half a step of 1/255, times 2.2 of the power, and divided by an alpha
# of down to 1/2 (its own half step is less); and by interpolation between pixels .12 rad wide, of the file
# and of the environment, an eighth of the square of that each, times a second derivative of up to 4 by both
# axes.
ERROR = 2.0 * 2.2 * 0.5 / 255.0 + 2 * 4 * 0.125 * (2.0 / SIZE) ** 2


def test_radiance_of_each_direction_is_that_of_the_cube(tmp_path: Path) -> None:
    scene = lit(cube()).load(tmp_path)
    assert scene.warnings == [] and NAME in scene.extensions_honoured
    environment = around(scene)
    assert environment.image.shape == (2 * SIZE, 4 * SIZE, 3)
    d = directions()
    assert off(environment, d, light_from(d)) < ERROR
    for axis in range(3):  # nothing that is turned or mirrored passes for it
        assert off(environment, d * np.where(np.arange(3) == axis, -1.0, 1.0), light_from(d)) > 10.0 * ERROR


@pytest.mark.parametrize("face", range(6), ids=FACES)
def test_each_face_lies_as_in_opengl(tmp_path: Path, face: int) -> None:
    """One pixel near a corner of one face shines, where OpenGL finds it."""
    faces = np.zeros((6, SIZE, SIZE, 3))
    column, row = 12, 2
    faces[face, row, column] = 1.0
    axis, sign, (s, s_sign), (t, t_sign) = OPENGL[FACES[face]]
    d = np.zeros(3)
    d[axis], d[s], d[t] = sign, s_sign * (25 / SIZE - 1.0), t_sign * (5 / SIZE - 1.0)
    image = around(lit(faces).load(tmp_path)).image[..., 0]
    y, x = np.unravel_index(image.argmax(), image.shape)
    theta, phi = (y + 0.5) * math.pi / (2 * SIZE), (x + 0.5) * math.pi / (2 * SIZE) - math.pi
    found = (math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))
    assert math.acos(min(np.dot(found, d) / np.linalg.norm(d), 1.0)) < math.pi / 2 / SIZE


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 2, -1)])
def test_the_rotation_turns_the_cube(tmp_path: Path, axis: tuple[float, float, float]) -> None:
    turn = axis_angle(axis, 1.1)
    environment = around(lit(cube(), rotation=list(turn)).load(tmp_path))
    d = directions()
    turned = d @ rotation_matrix(np.array(turn)).T
    assert off(environment, turned, light_from(d)) < ERROR


def test_the_intensity_is_a_factor(tmp_path: Path) -> None:
    environment = around(lit(cube(), intensity=250.0, name="hall").load(tmp_path))
    assert (environment.intensity, environment.name) == (250.0, "hall")
    d = directions(50)
    assert off(environment, d, 250.0 * light_from(d)) < 250.0 * ERROR


def test_light_beyond_one_is_divided_by_alpha(tmp_path: Path) -> None:
    """A lamp of 120 on a dark cube: its power, within the rounding of alpha, 1/120 of it, and of colors."""
    faces = np.full((6, SIZE, SIZE, 3), 0.25)
    faces[0, 4:8, 4:8] = 120.0
    environment = around(lit(faces).load(tmp_path))
    assert environment.image.max() == pytest.approx(120.0, rel=0.01)
    place = (np.arange(SIZE) + 0.5) * (2.0 / SIZE) - 1.0
    solid = (2.0 / SIZE) ** 2 * (1.0 + place[:, None] ** 2 + place**2) ** -1.5
    expected = float((faces @ np.array(LUMINANCE) * solid).sum())
    assert environment_power(environment_table(environment.image)) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("power", [1.0, 2.2])
def test_coefficients_of_irradiance_tell_how_colors_are_encoded(tmp_path: Path, power: float) -> None:
    scene = lit(cube(), rgbd(cube(), power)).load(tmp_path)
    d = directions(100)
    assert scene.warnings == []
    assert off(around(scene), d, light_from(d)) < ERROR


def test_pictures_without_alpha_are_not_divided(tmp_path: Path) -> None:
    faces = np.full((6, SIZE, SIZE, 3), 0.5)
    for kind in ("PNG", "JPEG"):
        image = around(lit(faces, rgbd(faces)[..., :3], kind).load(tmp_path)).image
        assert np.abs(image - 0.5).max() < 2.2 / 255.0


def test_the_largest_mip_is_shown(tmp_path: Path) -> None:
    builder = lit(cube())
    images = record_of(builder)["specularImages"]
    smaller = [builder.picture(np.zeros((8, 8, 4), np.uint8)) for _ in range(6)]
    images.append([builder.json["textures"][texture]["source"] for texture in smaller])
    assert around(builder.load(tmp_path)).image.shape == (2 * SIZE, 4 * SIZE, 3)


def test_faces_too_fine_for_an_environment_are_averaged(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(gltf_environment, "_FINEST", 8)
    environment = around(lit(cube()).load(tmp_path))
    assert environment.image.shape == (16, 32, 3)
    d = directions(100)
    assert off(environment, d, light_from(d)) < 4.0 * ERROR  # pixels are twice as wide


def test_a_light_that_no_scene_names_lights_nothing(tmp_path: Path) -> None:
    builder = lit(cube())
    del builder.json["scenes"][0]["extensions"]
    assert builder.load(tmp_path).environment is None


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"specularImages": []}, r"'hall' is left out: it has no specularImages; give the six"),
        ({"specularImages": [[0] * 5]}, r"'hall' is left out: specularImages\[0\] has 5 faces; give six"),
        ({"specularImages": [[0, 1, 2, 3, 4, 6]]}, r"left out: face -Z has 4 x 8 pixels; all six must be"),
        ({"specularImages": [[0, 1, 7, 3, 4, 5]]}, r"left out: face \+Y has 8 x 8 pixels; all six must be"),
        (
            {"specularImages": [[0, 1, 2, 8, 4, 5]]},
            r"left out: face -Y, picture 8, cannot be used: it is none",
        ),
    ],
)
def test_pictures_that_are_no_cube_leave_it_out(tmp_path: Path, changed: dict, said: str) -> None:
    builder = lit(cube(), name="hall")
    builder.picture(np.zeros((8, 4, 4), np.uint8))
    builder.picture(np.zeros((8, 8, 4), np.uint8))
    builder.put("images", {"bufferView": builder.view(b"no picture")})
    record_of(builder).update(changed)
    scene = builder.load(tmp_path)
    assert scene.environment is None and scene.triangle_count == 2
    (line,) = scene.warnings
    assert re.search(said, line), line


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rotation": [0, 0, 0, 0]}, "its rotation, no unit quaternion, counts as none"),
        ({"intensity": -1.0}, "its intensity of -1 is clamped to 0.."),
        ({"intensity": 1e300}, "its intensity of 1e+300 is clamped to 0.."),
        ({"specularImageSize": 256}, "its specularImageSize of 256 is passed over: its pictures have 16"),
        ({"irradianceCoefficients": []}, "it has 0 irradianceCoefficients in place of 9"),
    ],
)
def test_values_that_cannot_be_are_told_and_mended(tmp_path: Path, changed: dict, said: str) -> None:
    scene = lit(cube(), **changed).load(tmp_path)
    (line,) = scene.warnings
    assert line.startswith("image-based light 0: ") and said in line
    around(scene).check()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rotation": [0, 0, 1]}, r"extensions\.EXT_lights_image_based\.lights\[0\]\.rotation"),
        ({"intensity": "bright"}, r"lights\[0\]\.intensity"),
        ({"irradianceCoefficients": [[1.0, 2.0]]}, r"lights\[0\]\.irradianceCoefficients\[0\]"),
        ({"specularImages": [[0, 1, 2, 3, 4, -5]]}, r"lights\[0\]\.specularImages\[0\]\[5\]"),
        (
            {"specularImages": [[0, 1, 2, 3, 4, 99]]},
            r"light 0: face -Z: image 99 does not exist; the file has 6",
        ),
    ],
)
def test_records_that_are_none_refuse_the_file(tmp_path: Path, changed: dict, said: str) -> None:
    with pytest.raises(SceneError, match=rf"^scene\.gltf: .*{said}"):
        lit(cube(), **changed).load(tmp_path)


def test_a_scene_that_names_no_light_of_the_file_is_refused(tmp_path: Path) -> None:
    builder = lit(cube())
    builder.json["scenes"][0]["extensions"][NAME]["light"] = 3
    with pytest.raises(SceneError, match="image-based light 3 does not exist; the file has 1"):
        builder.load(tmp_path)


def test_limits_of_pictures_hold(tmp_path: Path) -> None:
    (line,) = lit(cube()).load(tmp_path, max_image_pixels=100).warnings
    assert "left out: face +X, picture 0, cannot be used: 16 x 16 pixels; max_image_pixels=100" in line
    assert around(lit(cube()).load(tmp_path, max_texture=8)).image.shape == (16, 32, 3)


def test_an_environment_that_is_asked_for_takes_its_place(tmp_path: Path) -> None:
    (tmp_path / "night.hdr").write_bytes(hdr(texels_of(np.full((2, 4, 3), 0.5))))
    scene = lit(cube()).load(tmp_path)
    surround(scene, Viewpoint(environment=str(tmp_path / "night.hdr")))
    assert around(scene).name == "night"
