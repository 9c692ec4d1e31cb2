#!/usr/bin/env bash
# One site in target/book: the pages of docs/ with search, the page of web/, the gallery of figures and the reference of every crate. Builds
# without a network once the dependencies are there. `docs/book.sh quick` leaves out what is not built yet.
#   the page       from web/, for wasm32-unknown-unknown
#   the gallery    target/figures, where `cargo xtask figures` put it; otherwise made with few trials
#   the reference  cargo doc
set -euo pipefail
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
book="$target/book"
quick=${1:-}
parts=()
rm -rf "$book"
mkdir -p "$book"

page="$target/web/page.html"
if rustup target list --installed 2>/dev/null | grep -qx wasm32-unknown-unknown; then
  [ "$quick" = quick ] && [ -f "$page" ] || (cd web && CARGO_TARGET_DIR="$target/web" cargo run --quiet --locked --package pack)
fi
if [ -f "$page" ]; then
  cp "$page" "$book/try.html"
  parts+=("Try it in the browser=try.html")
else
  echo "skipped: the page: rustup target add wasm32-unknown-unknown"
fi

figures="$target/figures"
if [ ! -f "$figures/index.html" ]; then
  figures="$target/quick-figures"
  [ "$quick" = quick ] || [ -f "$figures/index.html" ] || cargo xtask figures --quick --out "$figures"
fi
if [ -f "$figures/index.html" ]; then
  cp -r "$figures" "$book/figures"
  parts+=("Gallery of figures=figures/index.html")
else
  echo "skipped: the gallery: cargo xtask figures"
fi

if [ "$quick" != quick ]; then
  # A link to a crate is made only if the folder of that crate is there. Crates are documented in any order, and the folder of one is missing
  # while that crate begins: hence empty folders, and one crate at a time.
  rm -rf "$target/doc"
  for name in $(sed -n '/^\[package\]/,/^\[/s/^name = "\(.*\)"/\1/p' crates/*/Cargo.toml | tr - _); do mkdir -p "$target/doc/$name"; done
  cargo doc --workspace --no-deps --jobs 1 --quiet
fi
if [ -f "$target/doc/fewbits/index.html" ]; then
  cp -r "$target/doc" "$book/api"
  rm -f "$book"/api/*.json
  parts+=("Reference of the crates=api/fewbits/index.html")
else
  echo "skipped: the reference: cargo doc --workspace --no-deps"
fi

(cd web && CARGO_TARGET_DIR="$target/web" cargo run --quiet --locked --package site -- .. "$book" "${parts[@]}")
