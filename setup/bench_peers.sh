#!/usr/bin/env bash
# Fetches the force QP's peers (setup/bench.lock) into third_party/bench_peers: C and C++ sources, headers and libraries
# out of their Python packages. Only `make bench` needs them; nothing that is fetched already is fetched again.
set -euo pipefail
cd "$(dirname "$0")/.."
out=third_party/bench_peers
stamp=.setup/bench_peers
fail() { echo "setup: $*" >&2; exit 1; }

now=$(cat setup/bench.lock setup/bench_peers.sh | sha256sum)
[ "$(cat "$stamp" 2>/dev/null)" = "$now" ] && [ -d "$out" ] && exit 0
[ "$(uname -m)" = x86_64 ] || fail "the peers' packages are for x86_64: run build/release/bin/bench_force_qp by itself for our own engines"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo "setup: fetching the force QP's peers" >&2
.venv/bin/pip download -q --disable-pip-version-check --no-deps --no-binary daqp,piqp --require-hashes -r setup/bench.lock -d "$work" ||
  fail "pip could not fetch setup/bench.lock: check the network"
mkdir "$work/wheels" "$work/daqp" "$work/piqp"
for wheel in "$work"/*.whl; do .venv/bin/python -m zipfile -e "$wheel" "$work/wheels"; done
for peer in daqp piqp; do tar -xzf "$work"/$peer-*.tar.gz -C "$work/$peer" --strip-components=1; done
rm -rf "$out"
mkdir -p "$out"
mv "$work/wheels/cmeel.prefix" "$out/cmeel"
mv "$(find "$work/wheels" -type d -path "*/acados/install" -print -quit)" "$out/acados"
mv "$work/daqp" "$work/piqp" "$out"
echo "$now" > "$stamp"
