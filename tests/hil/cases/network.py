"""80-can0.network, by systemd-networkd: on vcan, and on a serial adapter whose other end is here, which has a bit rate as real controllers have."""

import os
import pathlib
import pty
import subprocess
import threading
import tty

from machine import check, make_can, output_of, packages, run, start_udev, wait_until

DROP_IN = pathlib.Path("/etc/systemd/network/80-can0.network.d/no-restart.conf")


def _networkd_said():
    return output_of("journalctl", "--no-pager", "-o", "cat", "-u", "systemd-networkd")


def _start_networkd():
    for mask in pathlib.Path("/run/systemd/system").glob("systemd-networkd*"):
        mask.unlink()
    start_udev()
    run("udevadm", "trigger", "--action=add", "--subsystem-match=net", "--settle")
    run("systemctl", "restart", "systemd-networkd")


def _status():
    return subprocess.run(["networkctl", "--no-pager", "status", "can0"], stdout=subprocess.PIPE, text=True).stdout


def _flags():
    return output_of("ip", "-details", "link", "show", "can0")


class SerialAdapter(threading.Thread):
    """A CAN adapter on a serial line, seen from the adapter's side: the commands that the kernel's driver sends."""

    def __init__(self):
        super().__init__(daemon=True)
        self._adapter, terminal = pty.openpty()
        tty.setraw(terminal)
        self.commands = b""
        self.start()
        run("modprobe", "slcan")
        run("slcan_attach", os.ttyname(terminal))

    def run(self):
        while True:
            self.commands += os.read(self._adapter, 100)


def vcan():
    run("dpkg-deb", "-x", packages()["relocd"], "/")
    make_can()
    run("ip", "link", "set", "can0", "down")
    _start_networkd()
    wait_until(lambda: "UP" in _flags().split(">")[0], "networkd brings can0 up")
    check("/usr/lib/systemd/network/80-can0.network" in _status(), "by the file that the package installs")
    complaints = [line for line in _networkd_said().splitlines() if "80-can0.network:" in line]
    check(not complaints, f"it has nothing to say against the file: {complaints}")


def bit_rate():
    run("dpkg-deb", "-x", packages()["relocd"], "/")
    adapter = SerialAdapter()
    wait_until(lambda: pathlib.Path("/sys/class/net/can0").exists(), "the adapter is can0")
    _start_networkd()
    # Its driver cannot come back from bus-off by itself, and says so.
    refusal = "can0: Failed to set CAN interface configurations: Device doesn't support restart from Bus Off"
    wait_until(lambda: refusal in _networkd_said(), "RestartSec reaches the driver, and one that cannot restart says so")
    DROP_IN.parent.mkdir(parents=True)
    DROP_IN.write_text("[CAN]\nRestartSec=0\n")
    run("networkctl", "reload")
    run("networkctl", "reconfigure", "can0")
    wait_until(lambda: "UP" in _flags().split(">")[0], "with the drop-in of docs/operations.md it is brought up")
    check("bitrate 500000" in _flags(), "with 500 kbit/s")
    wait_until(lambda: b"S6\r" in adapter.commands and b"O\r" in adapter.commands, "which the adapter is told, and opened")
