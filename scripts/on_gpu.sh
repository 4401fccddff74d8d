#!/usr/bin/env bash
# What a graphics card makes of all this, in one report, on a machine that needs no network.
#
#   scripts/on_gpu.sh --pack KIT [--python 3.12] [--wheel FILE] [--without NAME,...] [--size 320x180]
#
# Here, with network: put into the folder KIT the wheels for a Python of the machine over there (--python; --without
# leaves out what it has), loaders of Vulkan, references and assets where they are at hand, and llvmpipe's pictures.
#
#   scripts/on_gpu.sh KIT [--report FOLDER] [--only PART,...] [--minutes 9] [--size 320x180] [--quick]
#
# There, with this checkout and KIT: nothing is installed; wheels and loaders are unpacked to a folder in /tmp.
# Every part's output and exit code is kept in FOLDER (default: on_gpu), and FOLDER/report.md is written of them
# all, those of earlier runs too. A part that fails, or takes more minutes, does not stop the rest. Parts:
#
#   doctor    adapters, versions
#   kernels   compiled once, so that no later part waits for them
#   tests     of stages, pictures and parity
#   bench     ispm bench
#   talk      ispm bench --talk, three frames of each row
#   scenes    all built-in scenes
#   errors    of A, B and C, against the references
#   pictures  differences to llvmpipe's pictures, and how many there may be; --size as they were packed
#
# --quick: fewer tests, smaller pictures. ISPM_ADAPTER chooses an adapter, VK_DRIVER_FILES a driver.
set -u
cd "$(dirname "$0")/.."
. scripts/apt.sh

LOADERS='libvulkan1 libegl1 libgl1 libgles2 libglvnd0 libglx0 libopengl0 libx11-6 libxau6 libxcb1 libxdmcp6 libxext6
libbsd0 libmd0'
PARTS=doctor,kernels,tests,bench,talk,scenes,errors,pictures

say() { echo "on_gpu: $*" >&2; }
fail() { say "$*"; exit 2; }

kit= pack= report=on_gpu only=$PARTS minutes=9 size=320x180 quick= version=3.12 wheel= without=
while [ $# -gt 0 ]; do
    case $1 in
    --quick) quick=yes ;;
    --pack | --report | --only | --minutes | --size | --python | --wheel | --without)
        [ $# -ge 2 ] || fail "$1 wants a value"
        case $1 in
        --pack) pack=yes kit=$2 ;;
        --report) report=$2 ;;
        --only) only=$2 ;;
        --minutes) minutes=$2 ;;
        --size) size=$2 ;;
        --python) version=$2 ;;
        --wheel) wheel=$2 ;;
        --without) without=$2 ;;
        esac
        shift ;;
    -*) fail "there is no option $1; see the head of scripts/on_gpu.sh" ;;
    *) kit=$1 ;;
    esac
    shift
done
[ -n "$kit" ] || fail 'say which folder: scripts/on_gpu.sh KIT, or --pack KIT'

pack_all() {
    [ ! -e "$kit" ] || [ -d "$kit/wheels" ] || fail "$kit is there and no kit; name a new folder"
    scripts/setup.sh all || exit
    rm -rf "$kit" && mkdir -p "$kit/wheels" && kit=$(cd "$kit" && pwd)
    pip="$PWD/.venv/bin/python -m pip -q --disable-pip-version-check"
    if [ -n "$wheel" ]; then cp "$wheel" "$kit/wheels/"; else $pip wheel --no-deps -w "$kit/wheels" .; fi || exit
    platforms=$(for minor in 39 36 35 34 31 28 27 24 17 12 5; do echo "--platform manylinux_2_${minor}_x86_64"; done)
    $pip download -d "$kit/wheels" -c constraints.txt --only-binary=:all: --implementation cp \
        --python-version "$version" $platforms --platform manylinux2014_x86_64 \
        "$(echo "$kit"/wheels/ispm-*.whl)[test]" || exit
    for name in $(echo "$without" | tr , ' '); do rm -f "$kit/wheels/$name"-*.whl; done
    fetch "$kit/loaders" $LOADERS || say 'no loaders of Vulkan: apt cannot bring them'
    refs=${ISPM_REFS:-../shared/refs} assets=${ISPM_ASSETS:-../shared/assets}
    [ -d "$refs" ] && mkdir "$kit/refs" && cp "$refs"/scene_?.glb "$refs"/ref_?.npz "$kit/refs/"
    [ -d "$assets" ] && mkdir -p "$kit/assets/scenes" && cp "$assets/scenes/level_zdm2_lit.glb" "$kit/assets/scenes/"
    pictures llvmpipe && pictures aside --aside 0.0625 && pictures seed --seed 1 || exit
    du -sh "$kit" >&2
}

pictures() { # pictures NAME [OPTION...]: llvmpipe's layers, to the kit
    local folder=$kit/pictures/$1
    shift
    (cd tests && ISPM_ADAPTER=llvmpipe ../.venv/bin/python -m drivers.pictures "$folder" --size "$size" --maps "$@") ||
        return
    rm -f "$folder"/*.png
}

unpack() { # wheels and loaders, to a folder for this kit's contents alone
    room=${TMPDIR:-/tmp}/ispm-$(cat "$kit"/wheels/*.whl | cksum | cut -d' ' -f1)
    if [ ! -f "$room/ready" ]; then
        "$python" -m pip install -q --disable-pip-version-check --no-index --no-deps --target "$room/site" \
            "$kit"/wheels/*.whl || exit
        for file in "$kit"/loaders/*.deb; do
            [ -f "$file" ] && { dpkg -x "$file" "$room/loaders" || exit; }
        done
        touch "$room/ready"
    fi
    export PYTHONPATH="$room/site"
    for folder in "$room"/loaders/usr/lib/*-linux-gnu; do # only where the system has none
        ldconfig -p 2>/dev/null | grep -q libvulkan.so.1 || export LD_LIBRARY_PATH="$folder:${LD_LIBRARY_PATH:-}"
    done
}

find_driver() { # where loaders do not look: a card's that a container's runtime brought
    for file in /usr/local/*/share/vulkan/icd.d/*.json; do
        [ -f "$file" ] && [ ! -f "/usr/share/vulkan/icd.d/${file##*/}" ] && [ ! -f "/etc/vulkan/icd.d/${file##*/}" ] ||
            continue
        export VK_DRIVER_FILES="${VK_DRIVER_FILES:-$file}"
        export LD_LIBRARY_PATH="${file%/share/*}/lib64:${LD_LIBRARY_PATH:-}"
    done
    for file in /usr/local/*/share/glvnd/egl_vendor.d/*.json; do
        [ -f "$file" ] && [ ! -f "/usr/share/glvnd/egl_vendor.d/${file##*/}" ] || continue
        export __EGL_VENDOR_LIBRARY_FILENAMES="${__EGL_VENDOR_LIBRARY_FILENAMES:-$file}"
    done
}

ispm() { "$python" -P -m ispm "$@"; }
in_tests() { (cd tests && PYTHONPATH="$PYTHONPATH:$PWD" "$python" -P -m "$@"); }

part_doctor() {
    uname -a
    command -v nvidia-smi >/dev/null && nvidia-smi
    ispm doctor
}

part_kernels() { "$python" -P -m ispm.kernels; }

part_tests() {
    folders='tests/stages tests/parity tests/image'
    [ -n "$quick" ] && folders='tests/stages/test_gbuffer.py tests/parity'
    PYTHONPATH="$PYTHONPATH:$PWD/tests" "$python" -P -m pytest -p no:cacheprovider -n auto --maxprocesses 8 $folders
}

part_bench() { ispm bench ${quick:+--quick} -o "$report/bench.json"; }

part_talk() { ispm bench --talk --frames 3 ${quick:+--quick} -o "$report/talk.json"; }

part_scenes() {
    mkdir -p "$report/scenes" && bad=0
    for name in $("$python" -P -c 'from ispm.library.builtin import BUILTINS; print(*BUILTINS)'); do
        ispm render "$name" -o "$report/scenes/$name.png" --stats "$report/scenes/$name.json" \
            --size "$([ -n "$quick" ] && echo 320x180 || echo 1280x720)" || bad=1
    done
    return $bad
}

part_errors() { in_tests references.accuracy A B C --passes "$([ -n "$quick" ] && echo 1 || echo 16)"; }

part_pictures() {
    in_tests drivers.pictures "$room/pictures" --size "$size" --maps || return
    mkdir -p "$report/pictures" && cp "$room"/pictures/*.png "$report/pictures/"
    in_tests drivers.agreement "$room/pictures" "$kit/pictures/llvmpipe" \
        --aside "$kit/pictures/aside" --seed "$kit/pictures/seed"
}

run() { # run PART: keep what it says, its exit code (124: out of time) and its seconds
    say "$1"
    local code started
    started=$(date +%s)
    timeout -k 10 "${minutes}m" bash -c "part_$1" > "$report/$1.txt" 2>&1
    code=$?
    echo "$code $(($(date +%s) - started))" > "$report/$1.rc"
    say "$1: exit code $code"
    [ $code = 0 ]
}

write_report() {
    {
        echo '# On a graphics card'
        echo
        echo "$(date -u +%Y-%m-%d), $(uname -sr), ispm $(ispm --version 2>/dev/null)"
        echo
        echo '| part | exit code | seconds |'
        echo '|---|---:|---:|'
        for part in $(echo $PARTS | tr , ' '); do
            [ -f "$report/$part.rc" ] && read -r code seconds < "$report/$part.rc" &&
                echo "| [$part]($part.txt) | $code | $seconds |"
        done
        for part in $(echo $PARTS | tr , ' '); do
            [ -f "$report/$part.txt" ] || continue
            printf '\n## %s\n\n```\n' "$part"
            tail -n 120 "$report/$part.txt"
            echo '```'
        done
    } > "$report/report.md"
}

if [ -n "$pack" ]; then
    pack_all
    exit
fi
[ -d "$kit/wheels" ] || fail "$kit has no wheels; make it with: scripts/on_gpu.sh --pack $kit"
for part in $(echo "$only" | tr , ' '); do
    case ,$PARTS, in *,"$part",*) ;; *) fail "there is no part '$part'; there are $PARTS" ;; esac
done
python=$(command -v "${PYTHON:-python3}") || fail "there is no ${PYTHON:-python3}; set PYTHON"
case $python in /*) ;; *) python=$PWD/$python ;; esac # parts work in other folders
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "$python is too old; set PYTHON"
mkdir -p "$report" && report=$(cd "$report" && pwd) && kit=$(cd "$kit" && pwd)
unpack
find_driver
[ -d "$kit/refs" ] && export ISPM_REFS="$kit/refs"
[ -d "$kit/assets" ] && export ISPM_ASSETS="$kit/assets"
export kit report room python quick size
export -f ispm in_tests part_doctor part_kernels part_tests part_bench part_talk part_scenes part_errors part_pictures
failed=
for part in $(echo "$only" | tr , ' '); do run "$part" || failed="$failed $part"; done
write_report
say "failed:${failed:- none}; report: $report/report.md"
[ -z "$failed" ]
