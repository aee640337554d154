#!/usr/bin/env bash
# Brings everything that the build, the tests and the demo need onto a Debian 12 (or Ubuntu 24.04) machine.
# A step whose inputs have not changed since it last succeeded does nothing and needs no network.
set -euo pipefail
cd "$(dirname "$0")/.."
mkdir -p .setup third_party

fail() { echo "setup: $*" >&2; exit 1; }
say() { echo "setup: $*" >&2; }

# done_before NAME FILE...: true when NAME last succeeded with these same inputs.
stamp() { cat "$@" | sha256sum | cut -d' ' -f1; }
done_before() { local name=$1; shift; [ "$(cat ".setup/$name" 2>/dev/null)" = "$(stamp "$@")" ]; }
mark_done() { local name=$1; shift; stamp "$@" > ".setup/$name"; }

# Checked before the first install: what as_root runs has its output in a log.
need_root() { [ "$(id -u)" = 0 ] || command -v sudo >/dev/null || fail "needs root to install $*: run as root, or install sudo"; }
as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

# ---- Debian packages -------------------------------------------------------------------------------------------
is_installed() { [ "$(dpkg-query -W -f '${Status}' "$1" 2>/dev/null)" = "install ok installed" ]; }
version_at_least() { dpkg --compare-versions "$(dpkg-query -W -f '${Version}' "$1" 2>/dev/null || echo 0)" ge "$2"; }
apt_log=.setup/apt.log
apt() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@" >>"$apt_log" 2>&1; }
# Without Error-Mode, an update that fetched nothing counts as a success.
apt_update() {
  [ -n "${apt_updated:-}" ] || apt -o APT::Update::Error-Mode=any update || fail "apt-get update failed: check the network and this machine's Debian sources; see $apt_log"
  apt_updated=1
}
is_known() { apt-cache show "$1" >/dev/null 2>&1; }

# Debian 12 carries Catch2 2; its backports carry 3. The extra source is this machine's own, with the suite renamed.
enable_backports() {
  local suite own=/etc/apt/sources.list.d/debian.sources out=/etc/apt/sources.list.d/stance-backports
  suite=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")-backports
  say "adding $suite to this machine's Debian sources: $out.*"
  if [ -f "$own" ]; then
    awk -v suite="$suite" 'BEGIN { RS = ""; ORS = "\n\n" } !seen++ { sub(/Suites:[^\n]*/, "Suites: " suite); print }' "$own" | as_root tee "$out.sources" >/dev/null
  else
    awk -v suite="$suite" '$1 == "deb" && !seen++ { for (i = 2; i <= NF; i++) if ($i ~ /:\/\//) { $(i + 1) = suite; break } print }' /etc/apt/sources.list | as_root tee "$out.list" >/dev/null
  fi
}

install_debian() {
  command -v dpkg-query >/dev/null || fail "this is not a Debian or Ubuntu machine: install the packages of setup/debian.txt by hand, Catch2 3 too"
  local missing=() package
  while read -r package; do
    case $package in ''|'#'*) continue ;; esac
    is_installed "$package" || is_installed "${package}t64" || missing+=("$package")
  done < setup/debian.txt
  command -v cargo >/dev/null || [ -d "${STANCE_OSQP_SOURCE_DIR:-third_party/osqp}" ] || missing+=(cargo)
  : > "$apt_log"
  if [ ${#missing[@]} -gt 0 ]; then
    need_root "${missing[*]}"
    apt_update
    # Debian 12's own cargo is too old for the sparse protocol; cargo-web is the newer one, for the same use.
    local wanted=()
    for package in "${missing[@]}"; do
      [ "$package" = cargo ] && is_known cargo-web && package=cargo-web
      is_known "$package" || ! is_known "${package}t64" || package=${package}t64
      wanted+=("$package")
    done
    say "installing ${wanted[*]}"
    apt install --no-install-recommends -y "${wanted[@]}" || fail "apt-get install ${wanted[*]} failed: see $apt_log"
  fi
  if ! version_at_least catch2 3; then
    need_root "Catch2 3"
    say "installing Catch2 3"
    apt_update
    if ! apt-cache madison catch2 | awk '{ print $3 }' | grep -q '^3'; then
      enable_backports
      unset apt_updated; apt_update
    fi
    local version
    version=$(apt-cache madison catch2 | awk '$3 ~ /^3/ { print $3; exit }')
    [ -n "$version" ] || fail "no Catch2 3 to be had from this machine's Debian sources: enable backports, or install it by hand"
    apt install --no-install-recommends -y "catch2=$version" || fail "installing catch2 $version failed: see $apt_log"
  fi
}

# ---- Python ----------------------------------------------------------------------------------------------------
install_python() {
  local python=${STANCE_PYTHON:-python3}
  "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "needs Python 3.11 or newer: set STANCE_PYTHON to one"
  say "creating .venv with the pinned packages of setup/python.lock"
  rm -rf .venv
  "$python" -m venv .venv || fail "could not create .venv: apt-get install python3-venv"
  .venv/bin/pip install -q --disable-pip-version-check --require-hashes -r setup/python.lock || fail "pip could not install setup/python.lock: check the network"
}
install_package() {
  .venv/bin/pip install -q --disable-pip-version-check --no-deps --no-build-isolation --editable . || fail "pip could not install the package 'stance' of pyproject.toml"
}

# What the rigid-body core is compared with and timed beside: setup.sh peers.
install_peers() {
  say "installing the pinned packages of setup/peers.lock"
  .venv/bin/pip install -q --disable-pip-version-check --require-hashes -r setup/peers.lock || fail "pip could not install setup/peers.lock: check the network"
}

# ---- OSQP and QDLDL, vendored from pinned source ------------------------------------------------------------------
. setup/vendor.pins
# One hash over every file's path and content, in a fixed order.
tree_hash() { (cd "$1" && find . -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -d' ' -f1); }

vendor_osqp() {
  [ -n "${STANCE_OSQP_SOURCE_DIR:-}" ] && return
  local work; work=$(mktemp -d)
  mkdir -p "$work/src"; : > "$work/src/lib.rs"
  printf '[package]\nname = "fetch"\nversion = "0.0.0"\nedition = "2018"\n[dependencies]\nosqp-sys = "=%s"\n' "$OSQP_CRATE_VERSION" > "$work/Cargo.toml"
  say "fetching OSQP (crate osqp-sys $OSQP_CRATE_VERSION)"
  (cd "$work" && cargo vendor --quiet vendor >/dev/null) || fail "cargo vendor could not fetch osqp-sys $OSQP_CRATE_VERSION: check the network, or set STANCE_OSQP_SOURCE_DIR to an OSQP 1.0 source tree"
  grep -q "\"package\":\"$OSQP_CRATE_SHA256\"" "$work/vendor/osqp-sys/.cargo-checksum.json" || fail "osqp-sys $OSQP_CRATE_VERSION has not the pinned sha256: do not use it"
  # Older cargos leave hidden files out; nothing builds with them, so they go everywhere.
  find "$work/vendor/osqp-sys/osqp" -mindepth 1 -name '.*' -prune -exec rm -rf {} +
  local found; found=$(tree_hash "$work/vendor/osqp-sys/osqp")
  [ "$found" = "$OSQP_TREE_SHA256" ] || fail "the OSQP source tree hashes to $found, not to the pinned $OSQP_TREE_SHA256: do not use it"
  rm -rf third_party/osqp; mv "$work/vendor/osqp-sys/osqp" third_party/osqp; rm -rf "$work"
}
vendor_qdldl() {
  local work; work=$(mktemp -d)
  say "fetching QDLDL (sdist qdldl $QDLDL_SDIST_VERSION)"
  printf 'qdldl==%s --hash=sha256:%s\n' "$QDLDL_SDIST_VERSION" "$QDLDL_SDIST_SHA256" > "$work/pin.txt"
  .venv/bin/pip download -q --disable-pip-version-check --no-deps --no-binary qdldl --require-hashes -r "$work/pin.txt" -d "$work" || fail "pip could not fetch qdldl $QDLDL_SDIST_VERSION with the pinned hash: check the network"
  rm -rf third_party/qdldl; mkdir third_party/qdldl
  tar -xzf "$work"/qdldl-*.tar.gz -C third_party/qdldl --strip-components=3 --wildcards '*/c/qdldl/*'
  rm -rf "$work"
}

install_debian
done_before python setup/python.lock && [ -x .venv/bin/python ] || { install_python; mark_done python setup/python.lock; rm -f .setup/package .setup/peers; }
done_before package pyproject.toml || { install_package; mark_done package pyproject.toml; }
done_before osqp setup/vendor.pins && [ -d "${STANCE_OSQP_SOURCE_DIR:-third_party/osqp}" ] || { vendor_osqp; mark_done osqp setup/vendor.pins; }
done_before qdldl setup/vendor.pins && [ -d third_party/qdldl ] || { vendor_qdldl; mark_done qdldl setup/vendor.pins; }
[ "${1:-}" != peers ] || done_before peers setup/peers.lock || { install_peers; mark_done peers setup/peers.lock; }
