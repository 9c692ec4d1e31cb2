#!/usr/bin/env bash
# The pages of docs/ as a book with search, in target/book: `docs/book.sh` (needs mdbook: `cargo install mdbook --locked`).
set -euo pipefail
cd "$(dirname "$0")/.."
command -v mdbook >/dev/null || { echo "skipped: mdbook is not installed"; exit 0; }

rm -rf target/book-source
mkdir -p target/book-source/src
cp -r docs/*.md docs/images target/book-source/src/
# The order of the book is the order in which the index names its pages.
{
  echo '# fewbits'
  echo '- [Documentation](index.md)'
  grep -o '\[[^]]*\]([a-z-]*\.md)' docs/index.md | awk -F'[()]' '!seen[$2]++' | sed 's/^/- /'
} > target/book-source/src/SUMMARY.md
printf '[book]\ntitle = "fewbits"\n' > target/book-source/book.toml
mdbook build target/book-source --dest-dir ../book
