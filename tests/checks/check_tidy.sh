#!/usr/bin/env bash
# check_tidy.sh BUILD [BASE]: clang-tidy over our sources that changed since the commit BASE, or over all without it.
# It costs 12 s of CPU a file, so with BASE only what ships is checked, not the tests.
set -euo pipefail
cd "$(dirname "$0")/../.."

build=$1
if [[ $# -gt 1 ]]; then
  files=$(git diff --name-only --diff-filter=d "$2" -- 'lib/*.cc' 'daemons/*.cc' 'tools/*.cc')
else
  files=$(git ls-files '*.cc')
fi
# Files that this build does not compile (benchmarks switched off) have no command to be checked with.
files=$(for file in $files; do grep -q "/$file\"" "$build/compile_commands.json" && echo "$file"; done || true)
[[ -n "$files" ]] || { echo "clang-tidy: no changed source"; exit 0; }
xargs -n 1 -P "$(nproc)" clang-tidy -quiet -p "$build" <<<"$files" 2>&1 | { grep -vE 'warnings? generated|^$' || true; } | tee "$build/clang-tidy.txt"
[[ ! -s "$build/clang-tidy.txt" ]]
