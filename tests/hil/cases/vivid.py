"""Faults that only vivid can make, the kernel's virtual camera: in the stock guest, without systemd, camerad alone."""

import json
import pathlib
import re
import subprocess

from machine import binary, check, output_of, run, start, wait_until

CAMERA = "/dev/video10"
LOG = pathlib.Path("/tmp/camerad.log")


def _set(name, value=1):
    run("v4l2-ctl", "-d", CAMERA, "-c", f"{name}={value}")


def _get(name):
    return int(output_of("v4l2-ctl", "-d", CAMERA, "-C", name).split(":")[1])


def _values():
    """What camerad says of itself, once it has said something new; the guest is slow at starting a program."""
    said = json.loads(subprocess.run([binary("reloc"), "status", "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout)
    return next((daemon["values"] for daemon in said["daemons"] if daemon["daemon"] == "camerad_front"), {})


def _wait_for(name, above, what):
    wait_until(lambda: _values().get(name, 0) > above, what, 30)
    check(True, what)


def _check_images_go_on():
    before = _values()["frames"]
    wait_until(lambda: _values().get("frames", 0) > before + 5, "images go on", 30)


def _start_camerad():
    config = pathlib.Path("/tmp/robot.yaml")
    config.write_text(f"cameras: {{front: {{device: {CAMERA}, width: 320, height: 180, pixel_format: YUYV, frame_rate_hz: 25,\n"
                      "  controls: {exposure: auto, gain: 300, others: {brightness: 7}}}}\n")
    camerad = start(binary("camerad"), "--config", config, "--camera", "front", stderr=LOG.open("w"))
    _wait_for("frames", 5, "images come from vivid")
    return camerad


def camera_faults():
    camerad = _start_camerad()
    said = LOG.read_text()
    check("it has no exposure; gain is 255, asked for 300, allowed [0, 255]; autogain 0; brightness 7" in said, "the controls are set, clamped and said")
    check("YUYV 320 x 180 px at 25 Hz" in said, "as are format and frame rate")
    check((_get("gain"), _get("gain_automatic"), _get("brightness")) == (255, 0, 7), "and the driver has them")

    damaged = _values()["frames_damaged"]
    _set("inject_v4l2_buf_flag_error")
    _wait_for("frames_damaged", damaged, "a frame that the driver marks as damaged is counted")
    _check_images_go_on()

    dropped = _values()["frames_dropped"]
    _set("percentage_of_dropped_buffers", 60)
    _wait_for("frames_dropped", dropped + 10, "dropped frames are counted")
    _set("percentage_of_dropped_buffers", 0)
    _check_images_go_on()

    restarts = _values()["stream_restarts"]
    _set("inject_fatal_streaming_error")
    _wait_for("stream_restarts", restarts, "a stream that ends in an error is started again")
    _check_images_go_on()

    _set("brightness", 99)
    _set("inject_vidioc_streamon_error")  # of the next opening
    _set("disconnect")
    wait_until(lambda: "back after" in LOG.read_text(), "the camera is back", 20)
    said = LOG.read_text()
    check("No such device" in said, "a camera that goes away in the midst of streaming is said")
    check("starting the stream:" in said, "one that does not start to stream at once, too")
    away_s = float(re.search(r"back after ([0-9.]+) s", said).group(1))
    check(away_s < 2.0, f"it is back after {away_s} s")
    check(_get("brightness") == 7, "its controls are set again")
    _check_images_go_on()
    check(camerad.poll() is None, "all of that in one process")
