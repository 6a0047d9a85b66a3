#!/bin/sh
# Environments of their own for the tools that open exported files: .venv-interop/tools has SUMO, Lanelet2, CARLA's
# client and lxml; .venv-interop/qc has ASAM's checker of OpenDRIVE, which pins an older numpy; .venv-interop/commonroad has
# CommonRoad's reader, which pins an older protobuf; .venv-interop/criticality has CommonRoad-CriMe and ad-rss.
# usage: tests/interop/make_environment.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
for name in tools qc commonroad criticality; do
    "${1:-python3.11}" -m venv ".venv-interop/$name"
done
install() { name=$1; shift; ".venv-interop/$name/bin/pip" install --quiet --disable-pip-version-check "$@"; }
install commonroad commonroad-io==2026.1 commonroad-drivability-checker==2025.4.0 lxml==6.1.3
install criticality commonroad-crime==0.4.5 ad-rss==5.0.0
install tools eclipse-sumo==1.28.0 libsumo==1.28.0 traci==1.28.0 lanelet2==1.2.3 carla==0.9.16 lxml==6.1.3
install qc asam-qc-opendrive==1.0.0
echo "ready: .venv-interop"
