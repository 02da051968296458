"""What the cases share: the guest's devices, programs, and the passing of time."""

import json
import os
import pathlib
import socket
import struct
import subprocess
import threading
import time

SOURCE = BUILD = pathlib.Path()  # set by run_case.py

_started = []


class Failure(Exception):
    """A check did not hold."""


def binary(name):
    return BUILD / "bin" / name


def drive():
    """The rendered drive: a folder in the data set's layout, with can0.log and truth_body.csv."""
    return BUILD / "hil/drive"


def check(condition, what):
    if not condition:
        raise Failure(what)
    print("ok  ", what, flush=True)


def run(*command, **options):
    """Ends the case if the command fails."""
    print("+", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, **options)


def output_of(*command):
    return subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True, check=True).stdout


def start(*command, **options):
    """Runs beside the case, and is ended with it."""
    print("+", *command, "&", flush=True)
    process = subprocess.Popen([str(word) for word in command], **options)
    _started.append(process)
    return process


def end_processes():
    for process in _started:
        if process.poll() is None:
            process.kill()
            process.wait()


def wait_until(condition, what, timeout_s=10.0, period_s=0.02):
    """@return the seconds that it took, and ends the case if that is too long."""
    begin = time.monotonic()
    while True:
        if condition():
            return time.monotonic() - begin
        if time.monotonic() - begin > timeout_s:
            raise Failure(f"{what}: not within {timeout_s:g} s")
        time.sleep(period_s)


def print_journal(lines=60):
    journal = subprocess.run(["journalctl", "--no-pager", "-o", "short-monotonic", "-n", str(lines)], capture_output=True, text=True)
    print(journal.stdout, flush=True)


def feed_camera(device="/dev/video0", pixel_format="MJPG"):
    """Plays the drive's images on a loopback device, and waits until it is a camera."""
    player = start(binary("reloc"), "sim", "play", "--dataset", drive(), "--live-video", device, "--pixel-format", pixel_format,
                   stdout=subprocess.DEVNULL)

    def is_camera():
        told = subprocess.run(["v4l2-ctl", "-d", device, "--get-fmt-video"], capture_output=True, text=True)
        return f"'{pixel_format}'" in told.stdout
    wait_until(is_camera, f"{device} is a camera of {pixel_format}")
    return player


def packages():
    """The Debian packages by name."""
    return {path.name.split("_")[0]: path for path in (BUILD / "packages").glob("*.deb")}


def install(*names):
    """Installs packages of ours as an operator does; this machine has all that they depend on."""
    # In a container, as these tests' machine may be one, a policy keeps services from being started.
    pathlib.Path("/usr/sbin/policy-rc.d").unlink(missing_ok=True)
    for options in pathlib.Path("/etc/dpkg/dpkg.cfg.d").glob("*"):  # nor are manual pages installed there
        options.unlink()
    dpkg("-i", *(packages()[name] for name in names))
    start_udev()


def dpkg(*arguments):
    """As apt calls it where nobody is asked: an edited config is kept. Without the triggers of others, which index all manual pages anew."""
    run("dpkg", "--no-triggers", "--force-confold", "--force-confdef", *arguments, stdout=subprocess.DEVNULL)


def start_udev():
    """The device manager, which the guest does without until rules are wanted: it takes a second."""
    for mask in pathlib.Path("/run/systemd/system").glob("systemd-udevd*"):
        mask.unlink()
    run("systemctl", "daemon-reload")
    run("systemctl", "start", "systemd-udevd.service")
    run("udevadm", "trigger", "--action=add", "--subsystem-match=video4linux", "--settle")


def service(name, unit="relocd"):
    """A property of a unit."""
    return output_of("systemctl", "show", unit, "-p", name, "--value").strip()


def journal(unit="relocd"):
    return output_of("journalctl", "--no-pager", "-o", "cat", "-u", unit)


def make_can(name="can0"):
    run("ip", "link", "add", "dev", name, "type", "vcan")
    run("ip", "link", "set", name, "up")


CONFIG = pathlib.Path("/etc/relocd/robot.yaml")


def deploy(settings="", inference=False, config=None, ready=None):
    """The packages' files and accounts without the package manager, which takes longer; the service runs.

    `settings` are put before the config, which is the shipped one by default.
    """
    for log in pathlib.Path("/var/log/relocd").glob("*.lcmlog"):  # of this machine, which the guest sees
        log.unlink()
    for name in ("relocd", "relocd-tools"):
        run("dpkg-deb", "-x", packages()[name], "/")
    run("systemd-sysusers", "relocd.conf", stderr=subprocess.DEVNULL)
    run("systemd-tmpfiles", "--create", "relocd.conf")
    run("/lib/systemd/systemd-sysctl", "60-relocd.conf")
    for device in pathlib.Path("/dev").glob("video*"):  # as udev would
        run("chgrp", "video", device)
        device.chmod(0o660)
    supervisor = "" if inference else "supervisor: {inferenced: {enabled: false}}\n"
    CONFIG.write_text(settings + supervisor + (config or CONFIG.read_text()))
    run("systemctl", "daemon-reload")
    run("systemctl", "start", "relocd")
    ready = ready or ("5/5" if inference else "4/4")
    wait_until(lambda: service("StatusText").startswith(f"{ready} ready"), "all daemons are ready", 30)


def child(name):
    """The pid of a daemon of the service; 0 without one."""
    found = subprocess.run(["pgrep", "-x", "-P", service("MainPID"), name], stdout=subprocess.PIPE, text=True)
    return int(found.stdout.split()[0]) if found.stdout else 0


def cpu_s(pid):
    """The time on the CPU that a process has had."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Wheels(threading.Thread):
    """Sends the drive's CAN frames on time, and goes on where the interface is gone for a while."""

    def __init__(self, interface="can0"):
        super().__init__(daemon=True)
        self._interface = interface
        self._frames = []
        for line in (drive() / "can0.log").read_text().splitlines():
            stamp, _, frame = line.split()
            identifier, data = frame.split("#")
            payload = bytes.fromhex(data)
            self._frames.append((float(stamp[1:-1]), struct.pack("=IB3x8s", int(identifier, 16), len(payload), payload)))
        self.sent_ns = []  # CLOCK_MONOTONIC of each frame that was taken

    def run(self):
        bus, begin = None, time.monotonic()
        for due_s, frame in self._frames:
            time.sleep(max(0.0, begin + due_s - time.monotonic()))
            try:
                if bus is None:
                    bus = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
                    bus.bind((self._interface,))
                bus.send(frame)
                self.sent_ns.append(time.monotonic_ns())
            except OSError:
                bus = None


def raw_events(path):
    """The events of a file in LCM's log format: (channel, wall clock of the arrival in us, bytes)."""
    data, place = path.read_bytes(), 0
    while place + 28 <= len(data):
        sync, _, wall_us, channel_size, size = struct.unpack_from(">IqqII", data, place)
        begin = place + 28 + channel_size
        if sync != 0xEDA1DA01 or begin + size > len(data):
            place += 1
            continue
        yield data[begin - channel_size:begin].decode(), wall_us, data[begin:begin + size]
        place = begin + size


def events():
    """Every message that the recorder kept: (channel, CLOCK_MONOTONIC of the measurement in ns)."""
    wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
    for path in sorted(pathlib.Path("/var/log/relocd").glob("*.lcmlog")):
        for channel, _, body in raw_events(path):
            if channel.startswith("IMAGE_"):  # begins with the wall clock only
                yield channel, struct.unpack_from(">q", body, 8)[0] * 1000 - wall_minus_monotonic_ns
            elif len(body) >= 24:
                yield channel, struct.unpack_from(">q", body, 16)[0]


def times_of(channel):
    return [mono_ns for name, mono_ns in events() if name == channel]


def longest_gap_s(times_ns, begin_ns=0):
    times_ns = [time_ns for time_ns in times_ns if time_ns >= begin_ns]
    return max((b - a for a, b in zip(times_ns, times_ns[1:])), default=0) * 1e-9


def statuses():
    """What each daemon says of itself, by its name, with its values."""
    said = subprocess.run(["reloc", "status", "--json"], stdout=subprocess.PIPE, text=True).stdout
    return {daemon["daemon"]: daemon for daemon in json.loads(said)["daemons"]}
