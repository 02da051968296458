#!/usr/bin/env bash
# check_tidy.sh <build folder> [regex]: clang-tidy over our sources, or over those the regex matches.
set -euo pipefail
cd "$(dirname "$0")/../.."

run-clang-tidy -quiet -p "$1" -j "$(nproc)" "${2:-/(lib|daemons|tools|tests|benchmarks)/.*\.cc$}"
