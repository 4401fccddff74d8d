"""Whether two scenes are the same, down to the last bit and to what is shared within them."""

import dataclasses

import numpy as np

from ispm.scene.compact import compact
from ispm.scene.material import Material, Texture, TextureUse
from ispm.scene.mesh import DELTAS, Mesh

ARRAYS = ("normals", "tangents", "uv0", "uv1", "colors", "joints", "joint_weights")


def assert_alike(a, b):
    """Two scenes with the same nodes, contents, sharing and animations."""
    assert a.name == b.name
    mine, yours = a.nodes, b.nodes
    assert [n.name for n in mine] == [n.name for n in yours]
    assert [_children(n, mine) for n in mine] == [_children(n, yours) for n in yours]
    for p, q in zip(mine, yours, strict=True):
        _assert_nodes_alike(p, q)
        assert _joints(p, mine) == _joints(q, yours)
    parts = [[part for n in nodes for part in n.parts if len(part.mesh.triangles)] for nodes in (mine, yours)]
    for pick in (lambda p: p.mesh, lambda p: p.material):
        assert _sharing(map(pick, parts[0])) == _sharing(map(pick, parts[1]))
    assert [x.name for x in a.animations] == [x.name for x in b.animations]
    for p, q in zip(a.animations, b.animations, strict=True):
        for c, d in zip(p.channels, q.channels, strict=True):
            assert (_index(mine, c.node), c.path, c.interpolation) == (
                _index(yours, d.node),
                d.path,
                d.interpolation,
            )
            np.testing.assert_array_equal(c.times, d.times)
            np.testing.assert_array_equal(c.values, d.values)


def _assert_nodes_alike(a, b):
    if a.matrix is None:
        for name in ("translation", "rotation", "scale"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    else:
        np.testing.assert_array_equal(a.matrix, b.matrix)
    np.testing.assert_array_equal(a.instances, b.instances)
    np.testing.assert_array_equal(a.weights, b.weights)
    if a.skin is not None:
        np.testing.assert_array_equal(a.skin.inverse_bind, b.skin.inverse_bind)
    assert a.light == b.light and (a.light is None or a.light.name == b.light.name)
    assert (a.camera is None) == (b.camera is None)
    if a.camera is not None:
        np.testing.assert_array_equal(a.camera.pose, b.camera.pose)
        fields = ("yfov" if a.camera.ymag is None else "ymag", "ymag", "aspect", "principal", "name")
        assert [getattr(a.camera, f) for f in fields] == [getattr(b.camera, f) for f in fields]
    shown = [part for part in a.parts if len(part.mesh.triangles)]
    for p, q in zip(shown, b.parts, strict=True):
        assert_meshes_alike(p.mesh, q.mesh)
        assert _plain(p.material) == _plain(q.material)


def assert_meshes_alike(a: Mesh, b: Mesh):
    """The same arrays, but for vertices of `a` that no triangle uses."""
    triangles, rows = compact(a.triangles)
    np.testing.assert_array_equal(triangles, b.triangles)
    np.testing.assert_array_equal(a.positions[rows], b.positions)
    for name in ARRAYS:
        values = getattr(a, name)
        np.testing.assert_array_equal(values if values is None else values[rows], getattr(b, name))

    assert [m.name for m in a.morphs] == [m.name for m in b.morphs]
    for p, q in zip(a.morphs, b.morphs, strict=True):
        for name in DELTAS:
            values = getattr(p, name)
            np.testing.assert_array_equal(values if values is None else values[rows], getattr(q, name))


def _joints(node, nodes):
    """The name of a node's skin and the numbers of its joints."""
    return node.skin and (node.skin.name, [_index(nodes, joint) for joint in node.skin.joints])


def _plain(material: Material):
    """A material's values, textures told by what they show."""
    fields = {f.name: getattr(material, f.name) for f in dataclasses.fields(material)}
    for key, value in fields.items():
        if isinstance(value, Texture):
            value = TextureUse(value)
        if isinstance(value, TextureUse):
            t = value.texture
            shown = t.pixels.tobytes(), t.pixels.shape, t.srgb, t.wrap_u, t.wrap_v, t.linear, t.mipmaps
            fields[key] = *shown, value.uv_set, value.transform
    fields["base_color"] = (*fields["base_color"], 1.0)[:4]
    return fields


def _children(node, nodes):
    return [_index(nodes, child) for child in node.children]


def _index(nodes, node):
    return next(i for i, n in enumerate(nodes) if n is node)


def _sharing(items):
    """The same numbers for the same objects, in the order met."""
    seen = {}
    return [seen.setdefault(id(item), len(seen)) for item in list(items)]
