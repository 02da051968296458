"""The drivers' own tests, with a kernel that has their devices."""

import re
import subprocess

from machine import binary, check, feed_camera


def _run_tests(program, *arguments):
    """Runs a test binary. @return the names of the tests that were run, and of those that skipped."""
    done = subprocess.run([binary(program), "--gtest_color=no", *arguments], capture_output=True, text=True)
    failures = re.findall(r"^.*: Failure\n(?:.+\n)+", done.stdout, re.MULTILINE)
    print("\n".join([*failures, *done.stdout.splitlines()[-1:]]), flush=True)
    check(done.returncode == 0, f"{program} {' '.join(arguments)}")
    # A skipped test's name stands in the list at the end, too.
    skipped = set(re.findall(r"\[  SKIPPED \] ([\w/.]+)", done.stdout))
    return set(re.findall(r"\[ RUN      \] ([\w/.]+)", done.stdout)), skipped


def can():
    ran, skipped = _run_tests("can_tests")
    check(not skipped, f"none of {len(ran)} tests of lib/can skips: {sorted(skipped)}")
    check(sum(name.startswith("CanSocketKernelTest.") for name in ran) >= 4, "those on vcan0 were among them")


def _camera(pixel_format):
    player = feed_camera(pixel_format=pixel_format)
    ran, skipped = _run_tests("camera_tests", "--gtest_filter=V4l2*")
    check(not skipped, f"none of {len(ran)} tests of lib/camera's V4L2 skips: {sorted(skipped)}")
    check("V4l2KernelTest.ARealCameraGivesFrames" in ran, "the one with a real device was among them")
    player.kill()
    player.wait()


def camera():
    for pixel_format in ("MJPG", "YUYV"):
        _camera(pixel_format)
