"""The whole product on a robot: the packages, the shipped unit, CAN frames on can0 and a camera's images on /dev/video0."""

import csv
import json
import pathlib
import shutil
import time

from machine import check, child, cpu_s, drive, install, make_can, output_of, run, service, start, statuses, wait_until

CONFIG = pathlib.Path("/etc/relocd/robot.yaml")
MAP = pathlib.Path("/var/lib/relocd/maps/site.relocmap")


def set_up(pixel_format="MJPG"):
    """Brings the robot to where `reloc doctor` has nothing more to say: packages, map, bus, camera."""
    import machine
    make_can()
    install("relocd", "relocd-tools")
    shutil.copy(machine.SOURCE / "config/maps/campus.relocmap", MAP)
    run("sed", "-i", f"s/^    width: 640/    frame_rate_hz: 8\\n    pixel_format: {pixel_format}\\n    width: 640/", CONFIG)
    run("systemctl", "restart", "relocd")


def begin_drive(pixel_format="MJPG", epoch_in_s=9.0):
    """Plays the rendered drive on the bus and the camera. @return the player and CLOCK_MONOTONIC, in ns, of the drive's time 0."""
    epoch_ns = time.monotonic_ns() + int(epoch_in_s * 1e9)
    player = start("env", f"RELOCD_PLAYBACK_EPOCH_NS={epoch_ns}", "reloc", "sim", "play", "--dataset", drive(), "--live-can", "can0",
                   "--live-video", "/dev/video0", "--pixel-format", pixel_format)
    return player, epoch_ns


def logs():
    return sorted(pathlib.Path("/var/log/relocd").glob("*.lcmlog"))


def export(channel, epoch_ns, log):
    table = pathlib.Path(f"/tmp/{channel}.csv")
    run("reloc", "log", "export", log, "--channel", channel, "--config", CONFIG, "--time-origin-ns", epoch_ns, "--out", table)
    return table


def errors(channel, epoch_ns, log):
    """The pose of a channel against the drive's truth, as reloc eval says it."""
    return json.loads(output_of("reloc", "eval", "--truth", drive() / "truth_body.csv", "--estimate", export(channel, epoch_ns, log), "--json"))


def _play(pixel_format):
    set_up(pixel_format)
    player, epoch_ns = begin_drive(pixel_format)
    wait_until(lambda: service("StatusText").startswith("5/5 ready"), "all daemons are ready", 30)
    check(True, "all daemons are ready, before the drive begins" if time.monotonic_ns() < epoch_ns else "all daemons are ready")
    check(player.wait(timeout=60) == 0, "the drive was played")
    check(service("NRestarts") == "0", "relocd was not restarted")
    on_cpu_s = {name: round(cpu_s(child(name)), 1) for name in ("camerad", "inferenced", "odometryd", "recorderd", "smootherd")}
    print("seconds on the CPU:", on_cpu_s, flush=True)
    time.sleep(1.5)  # until all that came is in a status
    told = statuses()["inferenced"]["values"]
    run("systemctl", "stop", "relocd")
    (log,) = logs()[-1:]
    print(output_of("reloc", "log", "info", log), flush=True)
    channels = json.loads(output_of("reloc", "log", "info", log, "--json"))["channels"]
    check(channels["ODOMETRY"]["events"] >= 3000, f"{channels['ODOMETRY']['events']} ODOMETRY of 3045")
    check(channels["IMAGE_front"]["events"] >= 235, f"{channels['IMAGE_front']['events']} images of 244")
    accounted = told["images"] + told["IMAGE_front_superseded"]
    check(accounted == channels["IMAGE_front"]["events"],
          f"each image was worked on or counted: {told['images']:.0f} seen, {told['images_too_old']:.0f} of them too old, {told['IMAGE_front_superseded']:.0f} superseded")
    fused, camera = errors("LOCALIZATION", epoch_ns, log), errors("CAMERA_POSE", epoch_ns, log)
    print("camera", camera["position_m"], "fused", fused["position_m"], fused["rotation_deg"], flush=True)
    check(fused["position_m"]["mean"] < 1.0, f"mean error of the pose is {fused['position_m']['mean']:.2f} m")
    with open("/tmp/LOCALIZATION.csv") as table:
        said = [row["status"] for row in csv.DictReader(table)]
    check("ok" in said and "fault" not in said, f"its status is ok in {said.count('ok')} of {len(said)} messages, fault in none")


def mjpeg():
    _play("MJPG")


def yuyv():
    _play("YUYV")
