"""What must not happen: stale light, lost inputs, and a damaged cache that stops the work."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
from transport import box_room, lit, render

from ispm.cli.main import main
from ispm.errors import IspmError, SceneError, SceneWarning, SettingsError
from ispm.io.image import read_picture
from ispm.library.builtin import builtin
from ispm.library.shapes import box, icosphere
from ispm.renderer import Renderer
from ispm.renderer.progress import Progress
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight, Light, PointLight
from ispm.scene.material import Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene
from ispm.settings import Settings


def test_no_light_stays_when_the_lights_go_out(gpu):
    scene = builtin("cornell-box")
    with Renderer(scene, Settings(size=(160, 90), photons=4000), gpu=gpu) as renderer:
        assert renderer.render().indirect.any()
        light = scene.lights[0].light
        kept, light.intensity = light.intensity, (0.0, 0.0, 0.0)
        assert not renderer.render().radiance.any()
        light.intensity = kept
        renderer.settings = renderer.settings.replace(bounces=0)
        assert not renderer.render().indirect.any()


def test_a_closed_renderer_says_so(gpu):
    renderer = Renderer(box_room(), Settings(size=(16, 9)), gpu=gpu)
    renderer.close()
    renderer.close()
    with pytest.raises(IspmError, match="closed"):
        renderer.render()


def test_frames_can_be_pickled(gpu):
    frame, _ = render(gpu, lit(box_room()), size=(32, 18), photons=500)
    again = pickle.loads(pickle.dumps(frame))
    assert (again.radiance == frame.radiance).all() and set(again.layers) == set(frame.layers)
    assert len(repr(frame)) < 4000


@pytest.mark.parametrize(
    "make",
    [
        lambda: Mesh([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
        lambda: Camera(yfov=float("nan")),
        lambda: Camera(ymag=0.0),
        lambda: Camera(pose=np.eye(3)),
        lambda: Scene().add("a"),
        lambda: Renderer("cornell-box"),
    ],
)
def test_nonsense_is_refused_by_name(make):
    with pytest.raises((SceneError, SettingsError)):
        make()


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [
        (lambda scene: scene.nodes[0].parts[0].material, "metallic", 3.0),
        (lambda scene: scene.nodes[0].parts[0].material, "base_color", (np.nan, 0.0, 0.0)),
        (lambda scene: scene.nodes[0].parts[0].mesh, "normals", [[np.nan, 0.0, 0.0]]),
        (lambda scene: scene.lights[0].light, "intensity", (np.inf, 1.0, 1.0)),
        (lambda scene: scene.nodes[0], "rotation", (0.0, 0.0, 0.0, 0.0)),
        (lambda scene: scene.nodes[0], "parts", [Material()]),
    ],
)
def test_what_was_spoiled_since_it_was_made_makes_no_picture(gpu, owner, name, value):
    scene = lit(box_room())
    setattr(owner(scene), name, value)
    with pytest.raises(SceneError, match=name):
        render(gpu, scene)


def lit_plain(side: float, light: Light, height: float) -> Scene:
    """A box of 1 m on a square plain."""
    scene = Scene()
    scene.add(box((-side / 2, -1.0, -side / 2), (side / 2, 0.0, side / 2)))
    scene.add(box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5)))
    scene.add(light, rotation=(-0.5, 0.3, 0.0, 0.8), translation=(0.0, height, 0.0))
    scene.add(Camera.look_at((2.0, 1.5, 3.0), (0.0, 0.5, 0.0)))
    return scene


def test_light_that_photons_miss_is_told(gpu):
    with pytest.warns(SceneWarning, match="not one photon in a thousand met a second surface"):
        render(gpu, lit_plain(1000.0, PointLight(), 300.0), size=(32, 18), photons=4000)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for side in (10.0, 1000.0):  # the sun is aimed at what the eye sees
            render(gpu, lit_plain(side, DirectionalLight(), 0.0), size=(32, 18), photons=4000)


@pytest.mark.parametrize("name", ["positions", "triangles", "normals", "colors"])
def test_other_arrays_of_a_mesh_are_seen_without_a_word(gpu, name):
    """And the same ones are not read again, whatever others have."""
    scene = lit(box_room())
    scene.add(box((-0.2, 0.1, -0.2), (0.2, 0.5, 0.2)), name="box")
    mesh = scene["box"].parts[0].mesh
    with Renderer(scene, Settings(size=(64, 36), photons=500), gpu=gpu) as renderer:
        before = renderer.render()
        assert renderer.render().radiance.tobytes() == before.radiance.tobytes()
        geometry = renderer._ready._packed.geometry
        corners = len(mesh.positions)
        other = {
            "positions": lambda: mesh.positions * np.float32(0.5),
            "triangles": lambda: mesh.triangles[:-2],
            "normals": lambda: np.tile(np.float32([0.6, 0.0, 0.8]), (corners, 1)),
            "colors": lambda: np.full((corners, 4), 0.5),
        }[name]()
        setattr(mesh, name, other)
        after = renderer.render()
        assert renderer.render().radiance.tobytes() == after.radiance.tobytes()
        assert renderer._ready._packed.geometry is not geometry
        camera = renderer.camera
    with Renderer(scene, Settings(size=(64, 36), photons=500), camera=camera, gpu=gpu) as renderer:
        fresh = renderer.render()
    assert after.radiance.tobytes() == fresh.radiance.tobytes() != before.radiance.tobytes()


def swap_meshes(scene, turn):
    mesh, other = scene["spare"].parts[0].mesh, (icosphere(0.1, 2), icosphere(0.1, 7))[turn % 2]
    mesh.positions, mesh.triangles, mesh.normals = other.positions, other.triangles, other.normals


def swap_lights(scene, turn):
    for node in scene.roots[-20:]:
        node.light = PointLight() if turn % 2 else None


def come_and_go(scene, turn):
    scene.add(box((0, 0, 0), (0.01, 0.01, 0.01))) if turn % 2 else scene.roots.pop()


@pytest.mark.parametrize("edit", [swap_meshes, swap_lights, come_and_go])
def test_edits_by_another_thread_show_in_this_frame_or_the_next(gpu, edit):
    """Or are refused by name, where the frame found a mesh that was half another one."""
    scene = lit(box_room())
    scene.add(icosphere(0.1, 3), name="spare")
    for k in range(60):
        scene.add(box((0, 0, 0), (0.01, 0.01, 0.01)), translation=(0.01 * k, 0.0, 0.0))
    ended, before = threading.Event(), sys.getswitchinterval()

    def edit_on():
        turn = 0
        while not ended.is_set():
            turn += 1
            edit(scene, turn)

    other = threading.Thread(target=edit_on)
    sys.setswitchinterval(1e-5)
    try:
        other.start()
        with Renderer(scene, Settings(size=(32, 18), photons=200), gpu=gpu) as renderer:
            for _ in range(20):
                try:
                    renderer.render()
                except SceneError as error:
                    assert "mesh ''" in str(error)
    finally:
        ended.set()
        other.join()
        sys.setswitchinterval(before)


def test_a_sun_lights_what_is_seen_of_a_plain_however_wide(gpu):
    stored = [
        render(gpu, lit_plain(side, DirectionalLight(), 0.0), size=(64, 36))[0].stats.stored_photons
        for side in (100.0, 1e3, 1e4)
    ]
    # 40,000 photons over the whole of the widest would be one on 2,500 m2
    assert min(stored) > max(stored) / 2


def test_a_texture_may_stand_for_its_use(gpu):
    scene = lit(box_room())
    pixels = np.full((2, 2, 4), 255, np.uint8)
    scene.nodes[0].parts[0].material = Material(base_color_texture=Texture(pixels))
    assert render(gpu, scene, size=(16, 9), bounces=0)[0].radiance.any()


def test_threads_have_a_bound():
    with pytest.raises(SettingsError, match="threads"):
        Renderer(box_room(), threads=1_000_000)


def test_too_many_receivers_are_refused_before_the_work(gpu):
    side = gpu.max_texture
    if side * side * 64 <= gpu.max_binding:
        pytest.skip("this adapter binds more than its largest picture needs")
    with pytest.raises(SettingsError, match="subsampling"):
        Renderer(box_room(), Settings(size=(side, side), subsampling=1), gpu=gpu)


def test_compare_does_not_write_over_what_it_compares(tmp_path: Path, capsys):
    picture = tmp_path / "a.png"
    from ispm.io.image import write_png

    write_png(picture, np.zeros((4, 4, 3), np.uint8))
    before = picture.read_bytes()
    assert main(["compare", str(picture), str(picture), "--diff", str(picture)]) == 2
    assert main(["compare", str(picture), str(picture), "--diff", str(tmp_path / "d.exr")]) == 2
    assert picture.read_bytes() == before
    assert capsys.readouterr().err.count("ispm: ") == 2


def test_names_from_files_do_not_steer_the_terminal(capsys):
    assert main(["render", "\x1b[31mred.glb"]) == 2
    assert "\x1b" not in capsys.readouterr().err


def test_a_damaged_cache_costs_a_compilation_only(tmp_path: Path):
    code = "from ispm.optics.rng import random4; print(random4(1, 2, 3, 4)[0])"
    environment = {**os.environ, "ISPM_CACHE": str(tmp_path)}

    def run() -> str:
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    first = run()
    (file,) = tmp_path.glob("kernels/*.kernel")
    whole = file.read_bytes()
    for damaged in (b"", whole[:10], whole[:-1], whole[:40] + b"\0" * (len(whole) - 40), b"\xff" + whole[1:]):
        file.write_bytes(damaged)
        assert run() == first
        mended = file.read_bytes()
        assert len(mended) > 1000 and run() == first and file.read_bytes() == mended
    file.unlink()
    file.mkdir()
    assert run() == first


def test_a_kernel_under_another_ones_name_is_not_run(tmp_path: Path):
    """Whoever copies files about: one kernel's code under another's name would be called as the other."""
    code = "from ispm.optics import rng; print(rng.{}(1, 2, 3, 4)[0])"
    environment = {**os.environ, "ISPM_CACHE": str(tmp_path)}

    def run(kernel: str) -> str:
        done = subprocess.run(
            [sys.executable, "-c", code.format(kernel)], env=environment, capture_output=True, text=True,
            timeout=120,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    first = run("random4"), run("pcg4d")
    one, two = (next(tmp_path.glob(f"kernels/*{kernel}-*.kernel")) for kernel in ("random4", "pcg4d"))
    kept = one.read_bytes(), two.read_bytes()
    one.write_bytes(kept[1])
    two.write_bytes(kept[0])
    assert (run("random4"), run("pcg4d")) == first
    assert one.read_bytes() != kept[1] and two.read_bytes() != kept[0]  # compiled again


def test_frames_own_their_arrays_whatever_is_rendered_next(gpu):
    scene = builtin("cornell-box")
    with Renderer(scene, Settings(size=(640, 360), photons=1000), gpu=gpu) as renderer:
        first = renderer.render()
        kept = first.direct.copy(), first.radiance.copy()
        scene.lights[0].light.intensity = (1.0, 2.0, 3.0)
        direct = renderer.render().direct  # its frame is dropped at once
        others = [renderer.render() for _ in range(3)]
        assert (first.direct == kept[0]).all() and (first.radiance == kept[1]).all()
        assert all((direct == other.direct).all() for other in others)
        assert not (direct == kept[0]).all()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send a process SIGINT")
@pytest.mark.parametrize("request_to_end", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_keeps_the_passes_that_were_done(tmp_path, request_to_end):
    picture, kept = tmp_path / "a.png", tmp_path / "a.npz"
    words = ["render", "cornell-box", "--size", "64x36", "--photons", "1000", "--passes", "100k"]
    words += ["-o", str(picture), "--resume", str(kept)]
    with subprocess.Popen(
        [sys.executable, "-m", "ispm", *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        said = []
        for line in process.stderr:
            said.append(line)
            if line.startswith("2 passes"):
                process.send_signal(request_to_end)
                break
        out, rest = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out.split() == [str(kept), str(picture)]
    assert "interrupted" in rest and "Traceback" not in rest
    done = Progress.load(kept).passes
    assert done >= 2 and read_picture(picture).shape == (36, 64, 3)
    assert f"mean of {done} passes" in rest


LONG = [
    "render",
    "cornell-box",
    "--size",
    "64x36",
    "--photons",
    "1000",
    "--resume",
    "kept.npz",
    "-o",
    "a.png",
]


TINY = "render cornell-box --size 16x9 --photons 100 --quiet -o é.png"


def start(folder: Path, code: str, *words: str, env: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """A command line after some Python of a test."""
    script = f"import sys\nfrom ispm.cli.main import main\n{code}\nsys.exit(main(sys.argv[1:]))"
    return subprocess.Popen(
        [sys.executable, "-c", script, *words], cwd=folder, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, env=os.environ | (env or {}),
    )  # fmt: skip


def test_a_killed_process_leaves_the_passes_that_it_kept_on_the_way(tmp_path):
    with start(tmp_path, "from ispm.cli import passes; passes._EVERY = 0.0", *LONG, "--passes", "9k") as run:
        for line in run.stderr:
            if line.startswith("8 passes"):
                run.kill()
                break
        run.communicate(timeout=120)
    done = Progress.load(tmp_path / "kept.npz").passes
    assert done >= 1 and not (tmp_path / "a.png").exists()
    with start(tmp_path, "", *LONG, "--passes", str(done + 1)) as again:
        out, err = again.communicate(timeout=120)
    assert (again.returncode, out.split()) == (0, ["kept.npz", "a.png"]), err
    assert Progress.load(tmp_path / "kept.npz").passes == done + 1


def test_passes_that_cannot_be_kept_cost_no_picture(tmp_path):
    full = """
from ispm.cli import passes
from ispm.errors import OutputError
from ispm.renderer import Renderer
def full(self, path):
    raise OutputError(f"{path}: cannot be written: No space left on device")
Renderer.save_progress, passes._EVERY = full, 0.0
"""
    with start(tmp_path, full, *LONG, "--passes", "3") as run:
        out, err = run.communicate(timeout=120)
    assert (run.returncode, out) == (2, "a.png\n")
    assert err.count("rendering goes on") == 1
    assert err.splitlines()[-1] == "ispm: kept.npz: cannot be written: No space left on device"
    assert read_picture(tmp_path / "a.png").shape == (36, 64, 3)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize(
    "words", ["scenes --json", "render --print-config", "--version", "render --help", TINY]
)
def test_results_that_stdout_cannot_take_are_told_in_a_line(tmp_path, words):
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "ispm", *words.split()]
        run = subprocess.run(
            command, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120
        )
    assert run.returncode == 2
    assert run.stderr == "ispm: stdout: cannot be written: No space left on device\n"
    assert (tmp_path / "é.png").exists() == (words == TINY)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_work_goes_on_where_stderr_takes_nothing(tmp_path):
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "ispm", *TINY.replace("--quiet", "").split()]
        run = subprocess.run(
            command, cwd=tmp_path, stderr=full, stdout=subprocess.PIPE, text=True, timeout=120
        )
    assert (run.returncode, run.stdout) == (0, "é.png\n")


def test_names_that_stdout_cannot_write_are_told_in_a_line(tmp_path):
    with start(tmp_path, "", *TINY.split(), env={"PYTHONIOENCODING": "ascii"}) as run:
        out, err = run.communicate(timeout=120)
    assert (run.returncode, out) == (2, "")
    assert err == "ispm: stdout: is ascii, which cannot name '\\xe9.png'; set PYTHONIOENCODING=utf-8\n"
    assert read_picture(tmp_path / "é.png").shape == (9, 16, 3)
