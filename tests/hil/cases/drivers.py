"""The drivers' own tests, with a kernel that has their devices."""

import re
import subprocess

import machine
from machine import binary, check, deploy, feed_camera, journal, make_can, output_of, statuses, wait_until


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


def camera_controls():
    """With the loopback driver's own controls; it has none of a camera's, which is said."""
    def control(name):
        return int(output_of("v4l2-ctl", "-d", "/dev/video0", "-C", name).split(":")[1])
    make_can()
    asked = "{exposure: manual, gain: 20, others: {timeout: 70000, keep_format: 7, no_such_control: 1}}"
    shipped = (machine.SOURCE / "packaging/robot.yaml").read_text()
    deploy(config=shipped.replace("    width: 640\n", f"    width: 640\n    controls: {asked}\n"))
    feed_camera()
    wait_until(lambda: "MJPG 640 x 480 px" in journal(), "images come", 15)
    said = journal()
    for text in ("it has no exposure;", "it has no gain;", "it has no control 'no_such_control'", "jpeg_quality is the camera's own", "timeout 70000",
                 "keep_format is 1, asked for 7, allowed [0, 1]"):
        check(text in said, f"the journal says: {text}")
    check(said.count("controls:") == 1, "once")
    check(control("timeout") == 70000, "the driver has what was asked for")
    status = statuses()["camerad_front"]
    check(status["level"] == "WARNING" and "it has no gain" in status["message"], f"the status goes on saying so: {status['message']}")
    check("timeout" in output_of("sh", "-c", "reloc doctor || true"), "reloc doctor lists what the camera offers")


def camera():
    for pixel_format in ("MJPG", "YUYV"):
        _camera(pixel_format)
