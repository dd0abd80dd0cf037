# Shared by the scripts: messages, and the installation of what is missing. Sourced, not run.

readonly RUST_MINOR=95 # the `rust-version` of Cargo.toml

# A headline for what follows, and when the step before it ended.
step() {
  printf '\n== %s (after %d s)\n' "$1" "$SECONDS"
}

die() {
  printf '%s: %s\n' "$0" "$1" >&2
  exit 1
}

as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    die "cannot run '$*': become root or install sudo"
  fi
}

check_rust() {
  local advice="install Rust 1.$RUST_MINOR or newer with rustup, see https://rustup.rs"
  command -v cargo >/dev/null || die "there is no cargo: $advice"
  local version
  version=$(cargo --version | cut -d ' ' -f 2)
  [[ $version =~ ^1\.([0-9]+)\. ]] || die "cannot understand cargo's version $version"
  ((BASH_REMATCH[1] >= RUST_MINOR)) || die "cargo is of version $version: $advice"
  echo "cargo $version"
}

# The linker, and the compiler of the zstd library, which is built from C.
missing_build_packages() {
  command -v cc >/dev/null || echo gcc libc6-dev
}

# Installs the Debian packages that the function named by $1 prints.
install_packages() {
  local packages
  mapfile -t packages < <("$1" | tr ' ' '\n')
  if [ ${#packages[@]} -eq 0 ]; then
    echo "nothing is missing"
    return
  fi
  command -v apt-get >/dev/null || die "there is no apt-get: install ${packages[*]}"
  as_root apt-get update -q
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${packages[@]}"
}
