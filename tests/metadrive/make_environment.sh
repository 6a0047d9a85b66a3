#!/bin/sh
# An environment of its own for MetaDrive, which pins what the project does not want: .venv-metadrive, with
# numpy 1.26 beside its numpy 2 (put .venv-metadrive/numpy1 first on PYTHONPATH to use it).
# usage: tests/metadrive/make_environment.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-metadrive
"${1:-python3.11}" -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check metadrive-simulator==0.4.3 "numpy>=2,<3"
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --target "$venv/numpy1" --upgrade numpy==1.26.4
# MetaDrive downloads models and textures on first use. Without a window it opens none of them: it only asks for
# their version, and for one texture that older versions lacked.
assets=$("$venv/bin/python" -c "import importlib.util as u; print(u.find_spec('metadrive').submodule_search_locations[0])")/assets
mkdir -p "$assets/textures/grass1"
[ -e "$assets/version.txt" ] || echo 0.4.3 > "$assets/version.txt"
touch "$assets/textures/grass1/GroundGrassGreen002_COL_1K.jpg"
echo "ready: $venv/bin/python"
