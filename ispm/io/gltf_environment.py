"""The environment of a glTF scene (EXT_lights_image_based): a cube map as an equirectangular picture.

Source: Hsu and Bond, EXT_lights_image_based. What its text leaves open is said where it is decided.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.gltf_file import GltfFile, item, label
from ispm.io.gltf_image import image_bytes, image_called
from ispm.io.picture import Pictures
from ispm.scene.environment import HIGHEST, Environment
from ispm.scene.rotation import rotation_matrix
from ispm.scene.values import BRIGHTEST

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
# Of each face, as rows: where its column, its row (down) and its outside lead. As in OpenGL, whose cube
# maps the text means by standard orientations: it has a picture's first row on top, where its figure counts
# upwards.
_AXES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    np.float64,
)
_GAMMA = 2.2  # with which Babylon.js, the extension's first reader, writes and reads colors
_MEAN_OF_FIRST = math.sqrt(0.25 / math.pi) / math.pi  # mean radiance, of the first coefficient of irradiance
_FINEST = HIGHEST // 2  # pixels of a face's side: as fine as an environment may be
_ROWS = 8  # of the picture that are made at once
_STEPS_A_PIXEL = 100  # of loading, for a pixel that is made: a microsecond
_PASSING = 40  # bytes for a pixel of a face while its radiance is found


def read_environment(file: GltfFile, index: int) -> Environment | None:
    """Return the image-based light of this number; None, with a note, where its pictures show no cube.

    Its radiance counts in cd/m2. Its cube is in glTF's axes, and its rotation turns it there.
    Raises SceneError where the file has no such light, or no such picture.
    """
    record = item(file.gltf.extensions.image_based.lights, index, "image-based light")
    where = label("image-based light", index, record.name)
    for name, number in zip(FACES, (record.specular_images or [[]])[0], strict=False):
        item(file.gltf.images, number, f"{where}: face {name}: image")
    try:
        coded = _faces(file, record)
        size = min(coded.shape[1], _FINEST)
        file.budget.require(where, _PASSING * (coded[0].size // 4 + 6 * size * size))
        file.budget.take(where, memory=12 * 8 * size * size, work=_STEPS_A_PIXEL * 8 * size * size)
    except SceneError as error:
        file.notes.add(f"{where} is left out: {error}")
        return None
    if record.specular_image_size not in (None, coded.shape[1]):
        given = f"its specularImageSize of {record.specular_image_size:g}"
        file.notes.add(f"{where}: {given} is passed over: its pictures have {coded.shape[1]} pixels a side")
    faces = _radiance(file, record, coded, where)
    turn = np.eye(3)
    if 1e-3 < math.hypot(*record.rotation) < 1e3:
        turn = rotation_matrix(np.array(record.rotation))
    else:
        file.notes.add(f"{where}: its rotation, no unit quaternion, counts as none")
    image = unfolded(faces, turn)
    most = BRIGHTEST / (1.0 + float(image.max()))
    intensity = min(max(record.intensity, 0.0), most)
    if intensity != record.intensity:
        file.notes.add(f"{where}: its intensity of {record.intensity:g} is clamped to 0..{most:g}")
    return Environment(image, intensity=intensity, name=record.name)


def _faces(file: GltfFile, record: schema.ImageBasedLight) -> np.ndarray:
    """The six faces of the largest mip, (6, n, n, 4) uint8, as they are stored.

    Raises SceneError where they are no cube.
    """
    if not record.specular_images:
        raise SceneError("it has no specularImages; give the six faces of a cube, +X -X +Y -Y +Z -Z")
    first = record.specular_images[0]
    if len(first) != len(FACES):
        raise SceneError(f"specularImages[0] has {len(first)} faces; give six, +X -X +Y -Y +Z -Z")
    pictures = Pictures(file.budget, file.notes)
    faces: list[np.ndarray] = []
    for name, index in zip(FACES, first, strict=True):
        image = file.gltf.images[index]
        try:
            pixels = pictures.decode(image_bytes(file, image), srgb=False)
        except (SceneError, OSError) as error:
            raise SceneError(f"face {name}, {image_called(image, index)}, cannot be used: {error}") from None
        height, width = pixels.shape[:2]
        if height != width or (faces and len(faces[0]) != height):
            raise SceneError(
                f"face {name} has {width} x {height} pixels; all six must be squares of one size"
            )
        faces.append(pixels)
    return np.stack(faces)


def _radiance(file: GltfFile, record: schema.ImageBasedLight, coded: np.ndarray, where: str) -> np.ndarray:
    """Radiance of faces, (6, n, n, 3) float32.

    coded  (6, n, n, 4) uint8, RGBD: colors over alpha
    The text does not say how colors are encoded. Of the two ways that programs have, by a power and linear,
    the one counts whose mean is nearer to that of the coefficients of irradiance, which are linear.
    """
    ways = [np.stack([_decoded(face, power) for face in coded]) for power in (_GAMMA, 1.0)]
    if len(record.irradiance_coefficients) != 9:
        count = len(record.irradiance_coefficients)
        file.notes.add(
            f"{where}: it has {count} irradianceCoefficients in place of 9, which do not tell how its colors "
            f"are encoded; {_GAMMA} is taken"
        )
        return ways[0]
    said = sum(record.irradiance_coefficients[0]) / 3.0 * _MEAN_OF_FIRST
    means = [_mean(faces) for faces in ways]
    if said <= 0.0 or min(means) <= 0.0:
        return ways[0]
    return ways[int(np.argmin([abs(math.log(mean / said)) for mean in means]))]


def _decoded(face: np.ndarray, power: float) -> np.ndarray:
    """Radiance of a face in RGBD, (n, n, 3) float32, averaged to at most _FINEST a side."""
    code = np.arange(256, dtype=np.float32) / np.float32(255.0)
    light = (code ** np.float32(power))[face[..., :3]] / np.maximum(code, code[1])[face[..., 3:]]
    while len(light) > _FINEST:
        half = len(light) // 2
        light = light[: 2 * half, : 2 * half].reshape(half, 2, half, 2, 3).mean(axis=(1, 3))
    return np.asarray(light)


def _mean(faces: np.ndarray) -> float:
    """The mean over the sphere of a cube's faces, (6, n, n, 3), and their channels."""
    s = _centers(faces.shape[1])
    weights = (1.0 + s[:, None] ** 2 + s**2) ** -1.5
    return float((faces * weights[:, :, None]).sum() / (18.0 * weights.sum()))


def _centers(count: int) -> np.ndarray:
    """(count,) the places of pixels along a face, -1 to 1."""
    return (np.arange(count) + 0.5) * (2.0 / count) - 1.0


def unfolded(faces: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return a cube as an Environment's image, (2n, 4n, 3) float32.

    faces  (6, n, n, 3) radiance: +X -X +Y -Y +Z -Z
    turn   (3, 3) rotation from the cube's axes to the world's
    Each pixel is the mean of four directions within it, and the cube bilinear, also across its edges.
    """
    size = faces.shape[1]
    bordered = _bordered(faces)
    image = np.empty((2 * size, 4 * size, 3), np.float32)
    phi = (np.arange(8 * size) + 0.5) * (math.pi / (4 * size)) - math.pi
    for top in range(0, 2 * size, _ROWS):
        rows = min(_ROWS, 2 * size - top)
        theta = ((2 * top + np.arange(2 * rows) + 0.5) * (math.pi / (4 * size)))[:, None]
        sine = np.sin(theta)
        toward = np.stack([sine * np.sin(phi), np.cos(theta) + 0.0 * phi, -sine * np.cos(phi)], axis=-1)
        light = _bilinear(bordered, toward @ turn)
        image[top : top + rows] = light.reshape(rows, 2, 4 * size, 2, 3).mean(axis=(1, 3))
    return image


def _bordered(faces: np.ndarray) -> np.ndarray:
    """Faces, (6, n + 2, n + 2, 3), with the pixels of their neighbors around them."""
    size = faces.shape[1]
    s = (np.arange(-1, size + 1) + 0.5) * (2.0 / size) - 1.0
    u, v = np.meshgrid(s, s)
    bordered = np.empty((6, size + 2, size + 2, 3), np.float32)
    bordered[:, 1:-1, 1:-1] = faces
    beyond = np.ones((size + 2, size + 2), bool)
    beyond[1:-1, 1:-1] = False
    for k, axes in enumerate(_AXES):
        face, x, y = _places(np.stack([u, v, np.ones_like(u)], axis=-1)[beyond] @ axes, size)
        column, row = (np.clip(np.rint(p).astype(int), 0, size - 1) for p in (x, y))
        bordered[k, beyond] = faces[face, row, column]
    return bordered


def _places(toward: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The faces in directions (..., 3), and the places there: 0 at the first pixel's center, n - 1 at the
    last's, and up to a half beyond."""
    axis = np.abs(toward).argmax(axis=-1)
    along = np.take_along_axis(toward, axis[..., None], axis=-1)[..., 0]
    face = 2 * axis + (along < 0.0)
    x, y = (
        (np.einsum("...j,...j->...", _AXES[:, k][face], toward) / np.abs(along) + 1.0) * (0.5 * size) - 0.5
        for k in range(2)
    )
    return face, x, y


def _bilinear(bordered: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """(..., 3) what a cube shows in directions (..., 3)."""
    size = bordered.shape[1] - 2
    face, x, y = _places(toward, size)
    column, row = (np.clip((p + 1.0).astype(np.int64), 0, size) for p in (x, y))
    s, t = ((p + 1.0 - q).astype(np.float32)[..., None] for p, q in ((x, column), (y, row)))
    pixels, first = bordered.reshape(-1, 3), (face * (size + 2) + row) * (size + 2) + column
    above, below = (
        pixels.take(k, axis=0) * (1 - s) + pixels.take(k + 1, axis=0) * s for k in (first, first + size + 2)
    )
    return np.asarray(above * (1 - t) + below * t)
