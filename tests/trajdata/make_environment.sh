#!/bin/sh
# An environment of its own for trajdata, which pins an old protobuf and needs torch: .venv-trajdata.
# usage: tests/trajdata/make_environment.sh [python3.11]
# TORCH is the requirement of torch, as in tests/learn/make_environment.sh.
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-trajdata
"${1:-python3.11}" -m venv "$venv"
# Without its requirements for plots and raster maps; it works with the NumPy of its time.
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps trajdata==1.4.0
"$venv/bin/pip" install --quiet --disable-pip-version-check "${TORCH:-torch>=2.4,<3}" 'numpy<2' 'pandas<2.3' \
    'pyarrow<20' 'zarr<3' 'numcodecs<0.16' dill tqdm 'protobuf<3.21' kornia 'scipy<1.15' shapely \
    'opencv-python-headless<4.12' matplotlib
echo "ready: $venv/bin/python"
