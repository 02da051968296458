#!/usr/bin/env bash
# Fails, and shows where, if a source is not as .clang-format has it. With --fix, formats it instead.
set -euo pipefail
cd "$(dirname "$0")/../.."

mode=(--dry-run -Werror)
[[ "${1:-}" != "--fix" ]] || mode=(-i)
git ls-files -z '*.h' '*.cc' | xargs -0 -r clang-format "${mode[@]}"
