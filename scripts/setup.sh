#!/bin/sh
# Make ready what `make` needs: .venv with the package, its kernels compiled, and a graphics adapter.
#
#   scripts/setup.sh core   what a demo needs
#   scripts/setup.sh all    with the tools of the tests
#
# Safe to run again: it does only what is missing. Needs Python 3 and, as root or with sudo, apt
# for what the system lacks.
set -eu
cd "$(dirname "$0")/.."

kind=${1:-core}
packages=.
[ "$kind" = all ] && packages='.[test,dev]'
venv=.venv
stamp=$venv/.ready-$kind
inputs=$(cat pyproject.toml constraints.txt | cksum)

say() { echo "setup: $*" >&2; }
fail() { say "$*"; exit 1; }

. scripts/apt.sh

new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

find_python() { # print the first Python that will do
    for python in "${PYTHON:-python3}" python3 python3.14 python3.13 python3.12 python3.11; do
        if new_enough "$python"; then echo "$python"; return; fi
    done
    return 1
}

# Debian's python3 makes an environment without pip, or none, unless python3-venv is there.
make_venv() { # make_venv PYTHON FOLDER
    "$1" -c 'import ensurepip, venv' 2>/dev/null || {
        version=$("$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        install "python$version-venv" ||
            fail "Python $version lacks venv; run: sudo apt-get install python$version-venv"
    }
    "$1" -m venv "$2"
}

# Where every Python is too old, uv from PyPI brings one.
make_venv_by_uv() {
    command -v python3 >/dev/null || fail "there is no python3; run: sudo apt-get install python3-venv"
    say "$(python3 --version) is too old; fetching Python 3.12"
    [ -x .uv/bin/uv ] || { make_venv python3 .uv && .uv/bin/python -m pip install -q uv; }
    .uv/bin/uv venv -q --seed --python 3.12 "$venv" 2>/dev/null ||
        fail "ispm needs Python 3.11 or newer; install one and run: PYTHON=/path/to/python3.12 make"
}

ready() { # the stamp holds what the environment was made from; the fuller one serves for both
    for file in "$stamp" "$venv/.ready-all"; do
        [ -f "$file" ] && [ "$(cat "$file")" = "$inputs" ] && return 0
    done
    return 1
}

if ! ready; then
    if ! new_enough "$venv/bin/python" || ! "$venv/bin/python" -c 'import pip' 2>/dev/null; then
        rm -rf "$venv"
        if python=$(find_python); then make_venv "$python" "$venv"; else make_venv_by_uv; fi
    fi
    say "installing the packages (the first time about 300 MB)"
    "$venv/bin/python" -m pip install -q --disable-pip-version-check -c constraints.txt -e "$packages"
    echo "$inputs" > "$stamp"
fi

# What a picture needs compiled; a second where that was done before.
"$venv/bin/python" -m ispm.kernels || say "pictures will compile what they need"

# An adapter found once is not looked for again.
if [ ! -f "$venv/.ready-adapter" ]; then
    if ! "$venv/bin/ispm" doctor --quiet; then
        install libvulkan1 mesa-vulkan-drivers ||
            fail "no graphics adapter; run: sudo apt-get install libvulkan1 mesa-vulkan-drivers"
        "$venv/bin/ispm" doctor || exit
    fi
    touch "$venv/.ready-adapter"
fi

# The window of `ispm view` is tested on a display that nobody sees; apt is asked for one once.
if [ "$kind" = all ] && [ "$(uname)" = Linux ] && [ ! -f "$venv/.ready-display" ]; then
    command -v Xvfb >/dev/null || install xvfb || say "there is no Xvfb, tests of the window will be skipped"
    touch "$venv/.ready-display"
fi

# The page of `ispm view` is tested in a real browser; apt is asked for one once.
if [ "$kind" = all ] && [ ! -f "$venv/.ready-browser" ]; then
    has_browser || install chromium || say "there is no Chromium, tests of the page will be skipped"
    touch "$venv/.ready-browser"
fi
