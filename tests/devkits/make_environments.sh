#!/bin/sh
# Environments of their own for the owners' readers, whose pins the project does not want: .venv-devkits/nuscenes has
# nuScenes' devkit with numpy 1; .venv-devkits/readers has Argoverse 2's API (without torch, which only its sensor
# part needs), zarr 2, which reads Lyft's arrays, and pyogrio, that is GDAL, which reads GeoPackages.
# usage: tests/devkits/make_environments.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
for name in nuscenes readers; do
    "${1:-python3.11}" -m venv ".venv-devkits/$name"
done
install() { name=$1; shift; ".venv-devkits/$name/bin/pip" install --quiet --disable-pip-version-check "$@"; }
install nuscenes nuscenes-devkit==1.2.0
install readers numpy==2.2.6 pandas==2.3.3 polars==1.35.2 pyarrow==22.0.0 rich==14.2.0 scipy==1.16.3 \
    zarr==2.18.7 numcodecs==0.15.1 pyogrio==0.12.1 \
    shapely==2.1.2 universal-pathlib==0.3.10 opencv-python-headless==5.0.0.93 pillow==13.0.0 matplotlib==3.11.2
install readers --no-deps av2==0.3.6
echo "ready: .venv-devkits"
