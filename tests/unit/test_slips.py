"""Slips that would change nothing, or change it in silence, are told."""

import multiprocessing
import threading

import numpy as np
import pytest

import ispm
from ispm.renderer.renderer import Renderer
from ispm.scene.builtins_common import lambert
from ispm.scene.shapes import box

SMALL = ispm.Settings(size=(32, 18), photons=500, antialias=False)


@pytest.mark.parametrize(
    ("thing", "name", "said"),
    [
        (ispm.Node(), "material", "parts[0].material"),
        (ispm.Node(), "visible", "scene.remove"),
        (ispm.Node(), "translaton", "did you mean 'translation'?"),
        (ispm.Material(), "rougness", "did you mean 'roughness'?"),
        (ispm.PointLight(), "intensty", "did you mean 'intensity'?"),
        (ispm.Camera(), "yfow", "did you mean 'yfov'?"),
        (ispm.Scene(), "root", "did you mean 'roots'?"),
        (box((0, 0, 0), (1, 1, 1)), "position", "did you mean 'positions'?"),
        (ispm.Texture(np.zeros((1, 1, 3))), "pixel", "did you mean 'pixels'?"),
    ],
)
def test_attributes_that_are_none_are_refused(thing, name, said):
    with pytest.raises(AttributeError, match=r".") as refused:
        setattr(thing, name, 1)
    assert said in str(refused.value)


def test_lights_take_no_material():
    with pytest.raises(ispm.SceneError, match="a PointLight takes no material"):
        ispm.Scene().add(ispm.PointLight(), material=ispm.Material())


def test_textures_show_what_they_are_given(gpu):
    """Other pixels, and with `touch` those edited in place, in the picture and in the light that it sends."""
    texture = ispm.Texture(np.ones((4, 4, 3)))
    scene = ispm.Scene()
    material = lambert((1.0, 1.0, 1.0))
    material.base_color_texture = texture
    scene.add(box((-1, -1, -1), (1, 1, 1)), material=material)
    scene.add(ispm.PointLight((100, 100, 100)), translation=(0, 0, 5))
    camera = ispm.Camera.look_at((0, 0, 3), (0, 0, 0))
    with Renderer(scene, SMALL, camera, gpu=gpu) as renderer:
        assert renderer.render().albedo.max() == 1.0
        texture.pixels = np.zeros((4, 4, 3))
        assert renderer.render().albedo.max() == 0.0
        texture.pixels[...] = 255
        texture.touch()
        frame = renderer.render()
        assert frame.albedo.max() == 1.0 and frame.direct.max() > 0.0


def test_a_renderer_at_work_refuses_another_thread(gpu):
    found = []

    def work():
        try:
            with gpu.frame():
                pass
        except ispm.IspmError as error:
            found.append(str(error))

    with gpu.frame():
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert found == ["this renderer is at work in another thread; give each thread one of its own"]


def _render(queue):
    try:
        ispm.render("cornell-box", SMALL)
    except ispm.AdapterError as error:
        queue.put(str(error))
    else:
        queue.put("rendered")


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_is_told_to_be_spawned(gpu):
    gpu.frame()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_render, args=(queue,))
    child.start()
    assert "get_context('spawn')" in queue.get(timeout=60)
    child.join()


def test_render_tells_the_faults_of_files(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(ispm.SceneWarning, match="missing.mtl"):
        ispm.render(tmp_path / "a.obj", SMALL)
