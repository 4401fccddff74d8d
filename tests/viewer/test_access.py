"""Who is let in."""

import pytest

from ispm.errors import SettingsError
from ispm.viewer.access import Access, require_host


def token(access):
    return access.url().partition("token=")[2]


def test_a_token_is_good_once():
    access = Access("127.0.0.1", 8000)
    first, second = token(access), token(access)
    assert first != second
    value = access.spend(first)
    assert access.knows([f"a=b; {access.cookie}={value}"])
    assert access.spend(first) is None
    assert access.spend("") is None
    assert access.spend(second) == value


def test_cookies_that_are_not_the_sessions_are_not_known():
    access = Access("127.0.0.1", 8000)
    value = access.spend(token(access))
    for text in (
        "",
        access.cookie,
        f"{access.cookie}=",
        f"{access.cookie}=x",
        f"other={value}",
        f"{access.cookie}=ü",
    ):
        assert not access.knows([text])
    assert not Access("127.0.0.1", 8000).knows([f"{access.cookie}={value}"])


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "LOCALHOST:8000"])
def test_own_names_and_pages(host):
    access = Access("127.0.0.1", 8000)
    assert access.is_host(host)
    assert access.is_origin(f"http://{host}", host)


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8000",
        "127.0.0.1",
        "127.0.0.1:8001",
        "192.168.0.9:8000",
        "",
        "localhost:8000.evil",
    ],
)
def test_other_names(host):
    access = Access("127.0.0.1", 8000)
    assert not access.is_host(host)
    assert not access.is_origin(f"http://{host}", host)


@pytest.mark.parametrize(
    "origin", ["null", "http://evil.example", "https://127.0.0.1:8000", "http://127.0.0.1:8001", "file://"]
)
def test_other_pages(origin):
    assert not Access("127.0.0.1", 8000).is_origin(origin, "127.0.0.1:8000")


def test_a_server_for_others_goes_by_bare_addresses_and_no_name():
    access = Access("0.0.0.0", 8000)
    assert access.is_host("192.168.0.9:8000")
    assert access.is_origin("http://192.168.0.9:8000", "192.168.0.9:8000")
    assert not access.is_origin("http://192.168.0.8:8000", "192.168.0.9:8000")
    assert not access.is_host("evil.example:8000")  # its name could be changed to this address
    assert not access.is_host("192.168.0.9:8001")


def test_behind_a_proxy():
    access = Access("127.0.0.1", 8000, "https://example.org/view/")
    assert access.url().startswith("https://example.org/view/?token=")
    assert access.is_host("example.org")
    assert access.is_origin("https://example.org", "example.org")
    assert access.is_origin("https://example.org", "127.0.0.1:8000")  # a proxy may put its own name for it
    assert not access.is_origin("http://example.org", "example.org")
    for address in ("example.org", "ftp://example.org", "https://", "https://example.org/?a=b"):
        with pytest.raises(SettingsError, match="--public-url"):
            Access("127.0.0.1", 8000, address)


def test_other_machines_are_let_in_only_where_that_is_meant():
    for host in ("127.0.0.1", "localhost", "::1", "127.8.0.1"):
        require_host(host, False)
    for host in ("0.0.0.0", "::", "192.168.0.9", "example.org"):
        with pytest.raises(SettingsError, match="--allow-remote"):
            require_host(host, False)
        require_host(host, True)
