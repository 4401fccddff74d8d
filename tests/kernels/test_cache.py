"""Where what is kept between runs lies: never where others could have put code, nor in the working folder."""

import os
import pwd
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from ispm.cache import cache_fault, cache_folder
from ispm.errors import SceneWarning
from ispm.kernels import store

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="of Linux' folders and rights")


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    for name in ("ISPM_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    return home


@pytest.fixture
def fresh():
    """`store.written_folder` as in a new process."""
    store.written_folder.cache_clear()
    yield store.written_folder
    store.written_folder.cache_clear()


@pytest.mark.parametrize("given", ["", ".", "cache", "../cache"])
def test_a_cache_home_that_is_not_absolute_is_ignored(home, monkeypatch, given):
    monkeypatch.setenv("XDG_CACHE_HOME", given)
    assert cache_folder() == home / ".cache" / "ispm"
    assert os.listdir(".") == ["home"]


def test_an_absolute_one_is_used(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "kept"))
    assert cache_folder() == tmp_path / "kept" / "ispm"


def test_a_home_that_is_not_absolute_is_none(monkeypatch):
    monkeypatch.setenv("HOME", "relative")
    assert cache_folder() is None
    assert os.listdir(".") == ["home"]


def test_without_home_and_user_nothing_is_kept(monkeypatch, fresh):
    def unknown(_):
        raise KeyError

    monkeypatch.delenv("HOME")
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cache_folder() is None and cache_fault() == "" and fresh() is None


def test_pictures_need_neither_home_nor_user(tmp_path):
    code = (
        "import pwd\n"
        "def unknown(_): raise KeyError\n"
        "pwd.getpwuid = unknown\n"
        "from ispm.cli.main import main\n"
        "raise SystemExit(main(['doctor', '--json']) or main(['scenes', '--quiet', '--json']))"
    )
    environment = {k: v for k, v in os.environ.items() if k not in ("HOME", "USER", "LOGNAME")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert '"cache": null' in done.stdout


def test_what_is_made_is_the_users_own(home):
    mask = os.umask(0)
    try:
        folder = cache_folder()
    finally:
        os.umask(mask)
    assert folder is not None and folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("inner", ["", "kernels"])
def test_a_folder_that_others_may_write_is_refused_and_told_once(home, fresh, inner):
    folder = home / ".cache" / "ispm" / inner
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    with pytest.warns(SceneWarning, match=r"may be written by others, and is not used; chmod go-w") as told:
        assert fresh() is None
    assert fresh() is None and len(told) == 1


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give folders away")
def test_a_folder_of_somebody_else_is_refused(home, fresh):
    folder = home / ".cache" / "ispm"
    folder.mkdir(parents=True)
    os.chown(folder, 12345, 12345)
    assert cache_folder() is None
    with pytest.warns(SceneWarning, match=r"belongs to another user, and is not used; set ISPM_CACHE"):
        assert fresh() is None


def test_a_given_folder_stays_where_it_was_when_the_process_moves(tmp_path, monkeypatch):
    monkeypatch.setenv("ISPM_CACHE", "kept")
    assert cache_folder() == Path.cwd() / "kept"
