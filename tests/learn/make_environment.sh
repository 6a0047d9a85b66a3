#!/bin/sh
# An environment for the tests that need torch: .venv-learn, with torch beside the packages of .venv.
# usage: tests/learn/make_environment.sh [python3.11]
# TORCH is the requirement, for example TORCH=torch==2.13.0; on a machine without a GPU, an index of pip with builds for
# processors and TORCH=torch==2.13.0+cpu select the small one.
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-learn
"${1:-python3}" -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check "${TORCH:-torch>=2.4,<3}" \
    'stable-baselines3>=2.4,<3' 'minari>=0.5.3,<0.6' 'safetensors>=0.4,<1' 'onnx>=1.16,<2' 'onnxruntime>=1.18,<2'
site() { "$1/bin/python" -c 'import site; print(site.getsitepackages()[0])'; }
# Its own packages first: a path file adds those of .venv behind them, and addsitedir reads their path files, too.
echo "import site; site.addsitedir('$(site "$PWD/.venv")')" > "$(site "$venv")/project.pth"
echo "ready: $venv/bin/python"
