#!/usr/bin/env python3
"""campus_map_test.py SOURCE BUILD WORK: the shipped map of the campus fits the world that is rendered today, and training it anew
reaches the same accuracy.

A stretch of the route is driven in light that the map was not learned in. Then a map of this stretch alone is learned as the shipped
one was (tools/demo --train), but for fewer iterations, and finds the same images.
"""

import pathlib
import re
import shutil
import subprocess
import sys

SOURCE, BUILD, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
RELOC = BUILD / "bin/reloc"
SHIPPED = SOURCE / "config/maps/campus.relocmap"
VEHICLE = SOURCE / "config/vehicles/differential_demo.yaml"
TEACH_SESSIONS = ("noon+empty", "evening", "overcast+empty")
DRIVE_SESSION = "afternoon+reparked"
STRETCH_M = (220.0, 270.0)
MARGIN_M = 8.0  # what the teach laps have more on either side


def run(*command):
    print("+", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True).stdout


def render(name, session, rate_hz, begin_m, end_m):
    folder = WORK / name
    run(RELOC, "sim", "--world", "campus", "--seed", "7", "--session", session, "--vehicle", VEHICLE, "--frame-rate-hz", rate_hz,
        "--from-m", begin_m, "--to-m", end_m, "--out", folder)
    return folder


def accuracy(map_file, drive):
    """The part of the images that were found, and the median error of these in metres."""
    said = run(RELOC, "map", "localize", "--map", map_file, "--dataset", drive, "--out", WORK / "poses.csv", "--threads", "2")
    print(said, flush=True)
    found, images, median_m = re.match(r"localized (\d+) of (\d+) frames: median ([\d.]+) m", said).groups()
    return int(found) / int(images), float(median_m)


def check(condition, what):
    print("ok  " if condition else "FAIL", what, flush=True)
    if not condition:
        sys.exit(1)


def main():
    if not SHIPPED.exists():
        print(f"skipped: there is no {SHIPPED}, tools/demo --train makes it")
        sys.exit(77)
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    drive = render("drive", DRIVE_SESSION, 3, *STRETCH_M)
    found, shipped_m = accuracy(SHIPPED, drive)
    check(found >= 0.9 and shipped_m < 0.8, f"the shipped map finds {100 * found:.0f} % of the images, median error {shipped_m:.3f} m")

    laps = [render(f"teach-{session}", session, 4, STRETCH_M[0] - MARGIN_M, STRETCH_M[1] + MARGIN_M) for session in TEACH_SESSIONS]
    options = [word for lap in laps for word in ("--dataset", lap)]
    run(RELOC, "map", "train", *options, "--views", "5", "--iterations", "700", "--threads", "2", "--out", WORK / "again.relocmap")
    found, again_m = accuracy(WORK / "again.relocmap", drive)
    check(found >= 0.9 and again_m < 1.5 * shipped_m + 0.2, f"one learned anew {100 * found:.0f} %, median error {again_m:.3f} m")


if __name__ == "__main__":
    main()
