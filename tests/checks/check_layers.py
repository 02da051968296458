#!/usr/bin/env python3
"""Fails if a folder of lib/ includes a header of a folder that its CMakeLists.txt does not let it.

The include path is all of lib/, so the linker alone would not notice a header used from above. The order in
lib/CMakeLists.txt is the direction: a folder may depend only on those listed before it.
"""

import pathlib
import re
import sys

LIB = pathlib.Path(__file__).resolve().parent.parent.parent / "lib"


def allowed_folders() -> dict[str, set[str]]:
    """Each folder's own name and its dependencies, with what those may include in turn."""
    allowed: dict[str, set[str]] = {}
    for name in re.findall(r"add_subdirectory\((\w+)\)", (LIB / "CMakeLists.txt").read_text()):
        allowed[name] = {name}
        for dependency in re.findall(r"relocd::(\w+)", (LIB / name / "CMakeLists.txt").read_text()):
            if dependency not in allowed:
                sys.exit(f"lib/{name}/CMakeLists.txt: {name} depends on {dependency}, which is not above it in lib/CMakeLists.txt")
            allowed[name] |= allowed[dependency]
    return allowed


def main() -> int:
    allowed = allowed_folders()
    failures = 0
    for source in sorted([*LIB.rglob("*.h"), *LIB.rglob("*.cc")]):
        folder = source.relative_to(LIB).parts[0]
        for number, line in enumerate(source.read_text().splitlines(), start=1):
            match = re.match(r'#include "(\w+)/', line)
            if match and match[1] in allowed and match[1] not in allowed[folder]:
                print(f"{source.relative_to(LIB.parent)}:{number}: {folder} may not include {match[1]}")
                failures += 1
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
