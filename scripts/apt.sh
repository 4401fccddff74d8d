# For scripts that need what the system may lack: `. scripts/apt.sh`.

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then sudo -n "$@"
    else return 1
    fi
}

install() { # install PACKAGE...: by apt, quietly; fails where that cannot be
    command -v apt-get >/dev/null || return 1
    say "installing $*"
    as_root env DEBIAN_FRONTEND=noninteractive sh -c \
        'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"' sh "$@" >&2
}

fetch() { # fetch FOLDER PACKAGE...: download .deb files into it, install nothing; fails where that cannot be
    command -v apt-get >/dev/null || return 1
    folder=$1
    shift
    mkdir -p "$folder"
    say "fetching $*"
    (cd "$folder" && { apt-get download -qq "$@" 2>/dev/null ||
        { as_root apt-get update -qq && apt-get download -qq "$@"; }; } >&2)
}

has_browser() { for name in chromium chromium-browser google-chrome; do command -v $name && return; done >/dev/null; }
