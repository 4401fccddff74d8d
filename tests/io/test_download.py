"""Scenes by download, from a server on this machine: whole and known files, or one line."""

import hashlib
import os
import re
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from assets import assets

import ispm
from ispm.errors import SceneError, SettingsError
from ispm.io import download
from ispm.io.named import abouts, open_named
from ispm.io.save import save
from ispm.library.builtin import builtin


class Server(ThreadingHTTPServer):
    """Serves a folder, counts what it is asked for, and may cut its answers short."""

    cut = None

    def __init__(self, folder):
        self.asked = []
        super().__init__(("127.0.0.1", 0), lambda *a: Handler(*a, directory=str(folder)))


class Handler(SimpleHTTPRequestHandler):
    def do_GET(self):
        self.server.asked.append(self.path)
        super().do_GET()

    def copyfile(self, source, outputfile):
        data = source.read()
        outputfile.write(data[: self.server.cut])

    def log_message(self, *_):
        pass


@pytest.fixture
def server(tmp_path, monkeypatch):
    """A server of the scene `room`, two files, known by their checksums; cache and assets are empty."""
    folder = tmp_path / "served" / "room"
    save(builtin("cornell-box"), folder / "box.gltf")
    files = {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in folder.iterdir()}
    room = download.Download("A room.", "http://127.0.0.1:9/", "box.gltf", lambda: files)
    monkeypatch.setitem(download.DOWNLOADS, "room", room)
    with Server(tmp_path / "served") as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        monkeypatch.setenv("ISPM_DOWNLOADS", f"http://127.0.0.1:{running.server_port}/")
        monkeypatch.setenv("ISPM_CACHE", str(tmp_path / "cache"))
        monkeypatch.delenv("ISPM_ASSETS", raising=False)
        running.folder = folder
        yield running
        running.shutdown()


def kept(tmp_path):
    return sorted(f.name for f in (tmp_path / "cache").rglob("*") if f.is_file())


def test_a_scene_is_downloaded_once(server, tmp_path):
    for _ in range(2):
        scene = ispm.builtin("room")
        assert (scene.name, scene.triangle_count) == ("room", 30)
    assert sorted(server.asked) == ["/room/box.bin", "/room/box.gltf"]
    assert kept(tmp_path) == ["box.bin", "box.gltf"]
    assert open_named("room", max_triangles=30).triangle_count == 30
    assert "room" in abouts()


def test_a_file_with_another_checksum_is_refused_and_not_kept(server, tmp_path):
    (server.folder / "box.bin").write_bytes(b"not what it was")
    with pytest.raises(SceneError, match=r"'room' cannot be downloaded .*its checksum differs.*ISPM_ASSETS"):
        ispm.builtin("room")
    assert "box.bin" not in kept(tmp_path)


def test_an_answer_cut_short_is_refused_and_not_kept(server, tmp_path):
    server.cut = 100
    with pytest.raises(SceneError, match="'room' cannot be downloaded"):
        ispm.builtin("room")
    assert kept(tmp_path) == []


def test_a_damaged_file_in_the_cache_is_downloaded_again(server, tmp_path):
    ispm.builtin("room")
    (tmp_path / "cache" / "scenes" / "room" / "box.bin").write_bytes(b"damaged")
    assert ispm.builtin("room").triangle_count == 30
    assert server.asked.count("/room/box.bin") == 2


def test_what_is_not_there_is_told_in_one_line(server):
    (server.folder / "box.gltf").unlink()
    with pytest.raises(SceneError, match="404") as caught:
        ispm.builtin("room")
    assert "\n" not in str(caught.value)


def test_without_a_network_the_cure_is_told(server, monkeypatch):
    monkeypatch.setenv("ISPM_DOWNLOADS", "http://127.0.0.1:9")  # where nobody listens
    with pytest.raises(SceneError, match=r"there is no connection; put box.gltf .* ISPM_ASSETS names$"):
        ispm.builtin("room")


@pytest.mark.parametrize(
    "address", ["ftp://127.0.0.1/", "file:///srv", "s3://bucket", "127.0.0.1:80", "/srv/scenes"]
)
def test_other_schemes_are_named(server, tmp_path, monkeypatch, address):
    monkeypatch.setenv("ISPM_DOWNLOADS", address)
    with pytest.raises(
        SceneError, match=rf"ISPM_DOWNLOADS is '{re.escape(address)}'; .* begins with http://"
    ):
        ispm.builtin("room")
    assert kept(tmp_path) == []


def test_passwords_are_not_told(server, monkeypatch):
    there = os.environ["ISPM_DOWNLOADS"].removeprefix("http://")
    (server.folder / "box.gltf").unlink()
    for address in (f"http://me:s3cret@{there}", f"http://me:s3/c@ret@{there}", "ftp://me:s3cret@127.0.0.1/",
                    "http://me:s3cret@127.0.0.1:9", "http://me:s3cret@[/", "http://me:s3cret@/"):  # fmt: skip
        monkeypatch.setenv("ISPM_DOWNLOADS", address)
        with pytest.raises(SceneError) as caught:
            ispm.builtin("room")
        told = str(caught.value) + repr(caught.value.__cause__)
        assert "s3" not in told and "ret@" not in told and "checksum" not in told


def test_an_endless_answer_is_cut_and_not_kept(server, tmp_path, monkeypatch):
    monkeypatch.setattr(download, "_MAX_BYTES", 1000)
    (server.folder / "box.bin").write_bytes(bytes(1001))
    with pytest.raises(SceneError, match="a file has more than 1,000 bytes"):
        ispm.builtin("room")
    assert "box.bin" not in kept(tmp_path)


@pytest.mark.parametrize("place", ["box.gltf", "room/box.gltf"])
def test_a_scene_among_the_assets_is_not_downloaded(server, tmp_path, monkeypatch, place):
    target = tmp_path / "mine" / place
    target.parent.mkdir(parents=True)
    for file in server.folder.iterdir():
        (target.parent / file.name).write_bytes(file.read_bytes())
    monkeypatch.setenv("ISPM_ASSETS", str(tmp_path / "mine"))
    assert ispm.builtin("room").triangle_count == 30
    assert server.asked == []


def test_without_a_cache_the_cure_is_told(server, monkeypatch):
    monkeypatch.setattr(download, "cache_folder", lambda: None)
    with pytest.raises(SceneError, match=r"set ISPM_CACHE, or put box\.gltf"):
        ispm.builtin("room")


@pytest.mark.parametrize("name", download.DOWNLOADS)
def test_known_checksums_are_whole(name):
    known = download.DOWNLOADS[name]
    registry = known.registry()
    assert known.scene in registry
    assert all(re.fullmatch("[0-9a-f]{64}", checksum) for checksum in registry.values())
    assert known.address.startswith("https://") and re.search(r"/[0-9a-f]{40}/", known.address)


def test_the_bunny_is_the_one_that_is_known(monkeypatch):
    file = assets() / "meshes" / "bunny.ply"
    (checksum,) = download.DOWNLOADS["bunny"].registry().values()
    assert hashlib.sha256(file.read_bytes()).hexdigest() == checksum
    monkeypatch.setenv("ISPM_ASSETS", str(file.parent))
    assert ispm.builtin("bunny").triangle_count == 16_301


def test_sponza_has_as_many_files_as_its_model():
    assert len(download.DOWNLOADS["sponza"].registry()) == 71


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda: ispm.builtin("cornel-box"), SceneError, "did you mean 'cornell-box'"),
        (lambda: ispm.builtin("bunni"), SceneError, "did you mean 'bunny'"),
        (lambda: ispm.builtin("bunny", max_triangle=3), SettingsError, "did you mean 'max_triangles'"),
        (lambda: open_named("sponsa"), SceneError, "did you mean 'sponza'"),
        (lambda: ispm.render("cornel-box"), SceneError, "did you mean 'cornell-box'"),
    ],
)
def test_a_mistyped_name_is_answered_with_the_nearest(call, error, says):
    with pytest.raises(error, match=says):
        call()
