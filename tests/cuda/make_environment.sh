#!/bin/sh
# An environment for the tests of cameras on a graphics card: .venv-cuda, with numba-cuda and NVIDIA's compilers beside
# the packages of .venv. Neither a graphics card nor its driver is needed.
# usage: tests/cuda/make_environment.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-cuda
"${1:-python3}" -m venv "$venv"
site() { "$1/bin/python" -c 'import site; print(site.getsitepackages()[0])'; }
# Its own packages first: a path file adds those of .venv behind them, and addsitedir reads their path files, too.
echo "import site; site.addsitedir('$(site "$PWD/.venv")')" > "$(site "$venv")/project.pth"
# Without dependencies: of NVIDIA's toolkit only these are needed to compile, and numba is that of .venv.
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps 'numba-cuda>=0.30,<0.31' \
    'cuda-bindings>=13,<14' 'cuda-core>=0.5.1,<2' 'cuda-pathfinder>=1.4,<2' 'nvidia-nvvm>=13,<14' \
    'nvidia-cuda-nvrtc>=13,<14' 'nvidia-cuda-nvcc>=13,<14'
echo "ready: $venv/bin/python"
