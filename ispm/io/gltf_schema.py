"""The parts of glTF 2.0's JSON that are read, as typed records.

msgspec checks types, lengths and ranges while it parses; its errors name the place (`$.nodes[3].mesh`).
Values that a renderer can do without are held loosely here and judged where they are used.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from msgspec import field

from ispm.io.gltf_record import Count, Index, Matrix, Record, Vec3, Vec4
from ispm.io.gltf_schema_material import Image, Material, Sampler, Texture


class Asset(Record, frozen=True):
    """Which glTF this is."""

    version: str
    min_version: str | None = None


class Buffer(Record, frozen=True):
    """Bytes: a file beside this one, a data: URI, or (without `uri`) the binary chunk of a GLB."""

    byte_length: Count
    uri: str | None = None


class Meshopt(Record, frozen=True):
    """EXT_meshopt_compression: the bytes that a buffer view is decoded from."""

    buffer: Index
    byte_length: Count
    byte_stride: Count
    count: Count
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    byte_offset: Count = 0
    filter: Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"] = "NONE"


class ViewExtensions(Record, frozen=True):
    """Extensions of a buffer view."""

    meshopt: Meshopt | None = field(name="EXT_meshopt_compression", default=None)


class BufferView(Record, frozen=True):
    """A range of a buffer."""

    buffer: Index
    byte_length: Count
    byte_offset: Count = 0
    byte_stride: Count | None = None
    extensions: ViewExtensions = ViewExtensions()


class SparseIndices(Record, frozen=True):
    """Which elements of a sparse accessor are replaced."""

    buffer_view: Index
    component_type: Literal[5121, 5123, 5125]
    byte_offset: Count = 0


class SparseValues(Record, frozen=True):
    """What they are replaced by."""

    buffer_view: Index
    byte_offset: Count = 0


class Sparse(Record, frozen=True):
    """Elements that differ from the rest of an accessor."""

    count: Count
    indices: SparseIndices
    values: SparseValues


class Accessor(Record, frozen=True):
    """An array of numbers or vectors in a buffer view; without one, zeros."""

    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Count
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    buffer_view: Index | None = None
    byte_offset: Count = 0
    normalized: bool = False
    sparse: Sparse | None = None


class Draco(Record, frozen=True):
    """KHR_draco_mesh_compression: a stream, and its numbers of the attributes."""

    buffer_view: Index
    attributes: dict[str, Index]


class VariantMapping(Record, frozen=True):
    """A material of a primitive, and the variants that show it."""

    material: Index
    variants: list[Index]


class VariantMappings(Record, frozen=True):
    """KHR_materials_variants: what a primitive wears when."""

    mappings: list[VariantMapping] = []


class PrimitiveExtensions(Record, frozen=True):
    """Extensions of a primitive."""

    draco: Draco | None = field(name="KHR_draco_mesh_compression", default=None)
    variants: VariantMappings = field(name="KHR_materials_variants", default=VariantMappings())


class Primitive(Record, frozen=True):
    """Triangles, lines or points of one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: int = 4
    targets: list[dict[str, Index]] = []
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class Mesh(Record, frozen=True):
    """Primitives that are placed together."""

    primitives: list[Primitive]
    weights: list[float] = []
    name: str = ""
    extras: Any = None


class Perspective(Record, frozen=True):
    """A camera whose rays meet in a point."""

    yfov: float
    znear: float | None = None
    zfar: float | None = None


class Orthographic(Record, frozen=True):
    """A camera whose rays are parallel."""

    ymag: float
    znear: float | None = None
    zfar: float | None = None


class Camera(Record, frozen=True):
    """A camera of either kind."""

    type: str
    perspective: Perspective | None = None
    orthographic: Orthographic | None = None
    name: str = ""
    extras: Any = None


class Spot(Record, frozen=True):
    """The cones of a spot light, radians from its axis."""

    inner_cone_angle: float = 0.0
    outer_cone_angle: float = math.pi / 4.0


class Light(Record, frozen=True):
    """A light of KHR_lights_punctual."""

    type: str
    color: Vec3 = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    range: float | None = None
    spot: Spot = Spot()
    name: str = ""
    extras: Any = None


class LightUse(Record, frozen=True):
    """Which light stands at a node."""

    light: Index


class Instancing(Record, frozen=True):
    """EXT_mesh_gpu_instancing: where copies of the node's mesh stand."""

    attributes: dict[str, Index]


class NodeExtensions(Record, frozen=True):
    """Extensions of a node."""

    light: LightUse | None = field(name="KHR_lights_punctual", default=None)
    instancing: Instancing | None = field(name="EXT_mesh_gpu_instancing", default=None)


class Node(Record, frozen=True):
    """A node: a transform, what it shows, and its children."""

    name: str = ""
    children: list[Index] = []
    matrix: Matrix | None = None
    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    scale: Vec3 = (1.0, 1.0, 1.0)
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    weights: list[float] | None = None
    extensions: NodeExtensions = NodeExtensions()
    extras: Any = None


class Skin(Record, frozen=True):
    """Joints, which are nodes, and an accessor of how they stood when meshes were bound to them."""

    joints: list[Index]
    inverse_bind_matrices: Index | None = None
    name: str = ""


class SceneExtensions(Record, frozen=True):
    """Extensions of a scene."""

    image_based: LightUse | None = field(name="EXT_lights_image_based", default=None)


class Scene(Record, frozen=True):
    """The nodes that stand at the top."""

    nodes: list[Index] = []
    name: str = ""
    extensions: SceneExtensions = SceneExtensions()
    extras: Any = None


class ChannelTarget(Record, frozen=True):
    """What a channel moves."""

    path: str
    node: Index | None = None


class Channel(Record, frozen=True):
    """A sampler's values, given to a node."""

    sampler: Index
    target: ChannelTarget


class AnimationSampler(Record, frozen=True):
    """Keyframes: accessors of times and of values."""

    input: Index
    output: Index
    interpolation: str = "LINEAR"


class Animation(Record, frozen=True):
    """Channels that play together."""

    channels: list[Channel]
    samplers: list[AnimationSampler]
    name: str = ""


class Lights(Record, frozen=True):
    """All lights of the file."""

    lights: list[Light] = []


class ImageBasedLight(Record, frozen=True):
    """EXT_lights_image_based: a cube map of radiance, its pictures by mip and face."""

    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    intensity: float = 1.0
    irradiance_coefficients: list[Vec3] = []
    specular_images: list[list[Index]] = []
    specular_image_size: float | None = None
    name: str = ""


class ImageBasedLights(Record, frozen=True):
    """All image-based lights of the file."""

    lights: list[ImageBasedLight] = []


class Variant(Record, frozen=True):
    """The name of a variant."""

    name: str = ""


class Variants(Record, frozen=True):
    """KHR_materials_variants: all variants of the file."""

    variants: list[Variant] = []


class FileExtensions(Record, frozen=True):
    """Extensions of the whole file."""

    image_based: ImageBasedLights = field(name="EXT_lights_image_based", default=ImageBasedLights())
    lights: Lights = field(name="KHR_lights_punctual", default=Lights())
    variants: Variants = field(name="KHR_materials_variants", default=Variants())


class Gltf(Record, frozen=True):
    """A glTF 2.0 file's JSON."""

    asset: Asset
    accessors: list[Accessor] = []
    animations: list[Animation] = []
    buffers: list[Buffer] = []
    buffer_views: list[BufferView] = []
    cameras: list[Camera] = []
    extensions: FileExtensions = FileExtensions()
    extensions_required: list[str] = []
    extensions_used: list[str] = []
    images: list[Image] = []
    materials: list[Material] = []
    meshes: list[Mesh] = []
    nodes: list[Node] = []
    samplers: list[Sampler] = []
    scene: Index | None = None
    scenes: list[Scene] = []
    skins: list[Skin] = []
    textures: list[Texture] = []
