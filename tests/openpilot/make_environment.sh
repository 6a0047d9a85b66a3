#!/bin/sh
# An environment for the tests of openpilot's protocol: .venv-openpilot, with pycapnp, opendbc and comma's msgq, which is
# built here from the checkout in MSGQ, beside the packages of .venv. The tests need OPENPILOT, too: see tests/openpilot.
# usage: MSGQ=msgq tests/openpilot/make_environment.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-openpilot
"${1:-python3}" -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check 'pycapnp>=2.1,<3' 'opendbc>=0.3.1,<0.4' 'cython>=3,<4' setuptools
site() { "$1/bin/python" -c 'import site; print(site.getsitepackages()[0])'; }
if [ -n "${MSGQ:-}" ] && command -v g++ > /dev/null; then
    place="$(site "$PWD/$venv")"
    cp -r "$MSGQ/msgq" "$place/"
    bin="$PWD/$venv/bin"
    (
        cd "$place"
        "$bin/cython" --cplus -3 msgq/ipc_pyx.pyx msgq/visionipc/visionipc_pyx.pyx 2> /dev/null
        include="$("$bin/python" -c 'import sysconfig; print(sysconfig.get_paths()["include"])')"
        compile="g++ -O2 -w -fPIC -shared -std=c++17 -pthread -I. -Imsgq -I$include"
        core="msgq/ipc.cc msgq/event.cc msgq/impl_msgq.cc msgq/impl_fake.cc msgq/msgq.cc"
        vision="msgq/visionipc/visionipc.cc msgq/visionipc/visionipc_server.cc msgq/visionipc/visionipc_client.cc"
        $compile msgq/ipc_pyx.cpp $core -o msgq/ipc_pyx.so
        $compile msgq/visionipc/visionipc_pyx.cpp $core $vision msgq/visionipc/visionbuf.cc -o msgq/visionipc/visionipc_pyx.so
    )
else
    echo "openpilot's protocol is not tested: name a checkout of github.com/commaai/msgq in MSGQ, and install g++"
fi
# Its own packages first: a path file adds those of .venv behind them, and addsitedir reads their path files, too.
echo "import site; site.addsitedir('$(site "$PWD/.venv")')" > "$(site "$venv")/project.pth"
echo "ready: $venv/bin/python"
