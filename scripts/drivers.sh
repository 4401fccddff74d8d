#!/bin/sh
# Whether pictures are right on other drivers than the one at hand, and whether other compilers take the shaders.
#
#   scripts/drivers.sh [PART...]
#
#   llvmpipe     tests of stages, pictures and parity on Mesa's driver for processors
#   swiftshader  those of stages and parity on Google's, too slow for the rest
#   agreement    pictures of both, layer by layer: no further apart than edges and noise explain; SIZE=640x360: how large
#   validation   all built-in scenes under the validation layer of Khronos
#   tint         all pipelines in Chromium, whose compiler of WGSL is Tint
#
# Default: all. What apt cannot bring is skipped, with the reason. SwiftShader and the layer are only unpacked, in
# .drivers/; Chromium and Mesa are installed where they are missing.
set -u
cd "$(dirname "$0")/.."

cache=$PWD/.drivers
python=$PWD/.venv/bin/python
failed=
skipped=

say() { echo "drivers: $*" >&2; }
skip() { say "$1 is skipped: $2"; skipped="$skipped $1"; }
. scripts/apt.sh

unpack() { # unpack PACKAGE PATTERN...: its files of those names, into the cache, without their folders
    package=$1
    shift
    mkdir -p "$cache" && room=$(mktemp -d) && fetch "$room" "$package" && dpkg -x "$room"/*.deb "$room" &&
        (cd "$room" && cp $* "$cache/")
    status=$?
    rm -rf "$room"
    return $status
}

find_llvmpipe() { # print what the loader reads about it; likewise below
    for _ in once again; do
        for icd in /usr/share/vulkan/icd.d/lvp_icd*.json; do [ -f "$icd" ] && { echo "$icd"; return; }; done
        install libvulkan1 mesa-vulkan-drivers || return
    done
}

find_swiftshader() {
    for icd in /usr/lib/chromium/vk_swiftshader_icd.json "$cache/vk_swiftshader_icd.json"; do
        [ -f "$icd" ] && { echo "$icd"; return; }
    done
    unpack chromium-common usr/lib/chromium/libvk_swiftshader.so usr/lib/chromium/vk_swiftshader_icd.json >&2 &&
        echo "$cache/vk_swiftshader_icd.json"
}

find_layer() { # print where the loader looks for it
    for folder in /usr/share/vulkan/explicit_layer.d "$cache"; do
        [ -f "$folder/VkLayer_khronos_validation.json" ] && { echo "$folder"; return; }
    done
    unpack vulkan-validationlayers 'usr/lib/*/libVkLayer_khronos_validation.so' \
        usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json >&2 && echo "$cache"
}

on() { # on DRIVER COMMAND...: with that driver alone; the second variable is older loaders'
    icd=$1
    shift
    VK_DRIVER_FILES=$icd VK_ICD_FILENAMES=$icd "$@"
}

tests() { # tests DRIVER FOLDER...: with more patience than elsewhere, as SwiftShader takes several times as long
    icd=$1
    shift
    on "$icd" "$python" -m pytest -n auto --maxprocesses 8 --timeout 900 "$@"
}

pictures() { # pictures DRIVER NAME [OPTION...]
    icd=$1 name=$2
    shift 2
    (cd tests && on "$icd" "$python" -m drivers.pictures "$cache/pictures/$name" --size "${SIZE:-320x180}" "$@")
}

compare() {
    rm -rf "$cache/pictures"
    pictures "$1" llvmpipe && pictures "$1" aside --aside 0.0625 && pictures "$1" seed --seed 1 &&
        pictures "$2" swiftshader && (cd tests && "$python" -m drivers.agreement "$cache/pictures/swiftshader" \
            "$cache/pictures/llvmpipe" --aside "$cache/pictures/aside" --seed "$cache/pictures/seed")
}

validate() { (cd tests && VK_LAYER_PATH=$1 LD_LIBRARY_PATH=$1 "$python" -m drivers.validation); }

tint() { (cd tests && "$python" -m drivers.tint); }

for part in ${*:-llvmpipe swiftshader agreement validation tint}; do
    say "$part"
    case $part in
    llvmpipe | swiftshader)
        [ "$part" = llvmpipe ] && more=tests/image || more=
        if icd=$(find_"$part"); then tests "$icd" tests/stages tests/parity $more; else skip "$part" 'apt brings no such driver'; fi ;;
    agreement)
        if icd=$(find_llvmpipe) && other=$(find_swiftshader); then compare "$icd" "$other"
        else skip agreement 'it takes both drivers'; fi ;;
    validation)
        if folder=$(find_layer); then validate "$folder"
        else skip validation 'apt brings no vulkan-validationlayers'; fi ;;
    tint)
        if has_browser || install chromium; then tint
        else skip tint 'apt brings no chromium'; fi ;;
    *) say "there is no part '$part'; see the head of scripts/drivers.sh"; exit 2 ;;
    esac || failed="$failed $part"
done
say "failed:${failed:- none}; skipped:${skipped:- none}"
[ -z "$failed" ]
