#!/bin/sh
# An environment with planners of others: .venv-planners, whose own packages come before those of .venv.
# usage: tests/planners/make_environment.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-planners
"${1:-python3}" -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check \
    commonroad-reactive-planner==2025.1 frenetix==0.4.0 commonroad-io==2024.3 commonroad-clcs==2025.2.0 \
    commonroad-drivability-checker==2025.4.0 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2
site() { "$1/bin/python" -c 'import site; print(site.getsitepackages()[0])'; }
# Its own packages first: a path file adds those of .venv behind them, and addsitedir reads their path files, too.
echo "import site; site.addsitedir('$(site "$PWD/.venv")')" > "$(site "$venv")/project.pth"
echo "ready: $venv/bin/python"
