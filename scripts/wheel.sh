#!/bin/sh
# Build dist/ispm-*.whl with the compiled kernels of this Python, for Linux x86-64.
set -eu
cd "$(dirname "$0")/.."
kernels=dist/kernels
rm -rf "$kernels"
.venv/bin/python -m ispm.kernels --copy "$kernels"
ISPM_WHEEL_KERNELS=$PWD/$kernels .venv/bin/python -m pip wheel -q --disable-pip-version-check --no-deps -w dist .
rm -rf "$kernels"
ls -sh dist/*.whl
