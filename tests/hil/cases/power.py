"""The power is cut while the robot drives: what the disk has afterwards."""

import pathlib
import shutil
import subprocess
import time

import machine
from machine import check, drive, journal, make_can, run, start, wait_until

DISK = pathlib.Path("/mnt/disk")
STATE = DISK / "smootherd.state"
CUT = pathlib.Path("/hil/cut")  # outlives the guest: the wall clock when the power was cut


def _mount():
    DISK.mkdir(parents=True)
    run("mount", "-t", "ext4", "/dev/ubda", DISK)
    run("chmod", "777", DISK)


def _configure():
    """The saved pose and the recordings are on the disk."""
    unit = pathlib.Path("/run/systemd/system/relocd.service.d/disk.conf")
    unit.parent.mkdir(parents=True, exist_ok=True)
    unit.write_text(f"[Service]\nReadWritePaths={DISK}\n")
    return f"recorder: {{directory: {DISK}/log, min_free_mb: 10}}\n"


def _before():
    run("mkfs.ext4", "-q", "/dev/ubda")
    _mount()
    pathlib.Path("/var/lib/relocd/maps").mkdir(parents=True, exist_ok=True)
    shutil.copy(machine.SOURCE / "config/maps/campus.relocmap", "/var/lib/relocd/maps/site.relocmap")
    make_can()
    settings = _configure()
    shipped = machine.SOURCE / "packaging/robot.yaml"
    text = shipped.read_text().replace("localization:\n", f"localization:\n  state_file: {STATE}\n  state_period_s: 0.5\n")
    machine.deploy(settings, inference=True, config=text)
    first_ns = time.monotonic_ns() + 1_500_000_000
    start("env", f"RELOCD_PLAYBACK_EPOCH_NS={first_ns}", "reloc", "sim", "play", "--dataset", drive(), "--live-can", "can0",
          "--live-video", "/dev/video0", stdout=subprocess.DEVNULL)
    wait_until(STATE.exists, "the pose is saved", 30)
    time.sleep(8.0)
    check(True, "the robot drives, its pose is saved twice a second: the power is cut now")
    CUT.write_text(str(time.time()))
    pathlib.Path("/proc/sysrq-trigger").write_text("b")  # at once, and nothing is written any more
    time.sleep(60)


def _after():
    cut_s = float(CUT.read_text())
    _mount()
    lines = STATE.read_text().splitlines()
    check(lines[0] == "format: relocd smootherd 1" and lines[-1].startswith("covariance: "), "the saved pose is there, and whole")
    logs = list((DISK / "log").glob("*.lcmlog"))
    info = subprocess.run([machine.binary("reloc"), "log", "info", *logs], capture_output=True, text=True)
    print(info.stdout, info.stderr, flush=True)
    check(info.returncode == 0 and logs, "the recording can be read")
    last_s = max(_times(logs))
    check(cut_s - last_s < 10.0, f"it ends {cut_s - last_s:.1f} s before the cut")
    make_can()
    settings = _configure()
    text = (machine.SOURCE / "packaging/robot.yaml").read_text().replace("localization:\n", f"localization:\n  state_file: {STATE}\n")
    machine.deploy(settings, config=text)
    wheels = machine.Wheels()
    wheels.start()
    wait_until(lambda: "the saved pose is of an earlier boot: not used" in journal(), "smootherd reads it, and says why it is not used", 10)


def _times(logs):
    for log in logs:
        for _, wall_us, _ in machine.raw_events(log):
            yield wall_us * 1e-6


def cut():
    (_after if CUT.exists() else _before)()
