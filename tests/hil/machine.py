"""What the cases share: the guest's devices, programs, and the passing of time."""

import pathlib
import subprocess
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
