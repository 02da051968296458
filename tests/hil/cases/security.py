"""What the unit's sandbox keeps away, and what happens where it cannot."""

import pathlib
import re
import socket
import struct
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent))  # this file runs by itself, too

from machine import check, child, deploy, journal, make_can, output_of, run, service, wait_until  # noqa: E402

_MAGIC_OF_FRAGMENTS = 0x4C433033
_PORT = 7667


def _crafted():
    """Two datagrams that make liblcm 1.3.1 write outside its buffers: a message's beginning, and a part of it whose place and size add up to
    more than 32 bits hold."""
    def fragment(offset, number, payload):
        return struct.pack(">IIIIHH", _MAGIC_OF_FRAGMENTS, 1, 1000, offset, number, 2) + payload
    return fragment(0, 0, b"ODOMETRY\0" + bytes(10)), fragment(0xFFFFFF00, 1, bytes(0x180))


def send(address):
    """Run by itself in another network."""
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    for datagram in _crafted():
        sender.sendto(datagram, (address, _PORT))


def _send_from_outside(address):
    run("ip", "netns", "exec", "outside", sys.executable, __file__, address)


def _make_outside():
    run("modprobe", "veth")
    run("ip", "netns", "add", "outside")
    run("ip", "link", "add", "inner", "type", "veth", "peer", "name", "outer", "netns", "outside")
    run("ip", "addr", "add", "10.9.9.1/24", "dev", "inner")
    run("ip", "link", "set", "inner", "up")
    run("ip", "-n", "outside", "addr", "add", "10.9.9.2/24", "dev", "outer")
    run("ip", "-n", "outside", "link", "set", "outer", "up")
    time.sleep(1.0)  # until both ends have their addresses


def exposure():
    make_can()
    deploy()
    told = output_of("systemd-analyze", "security", "--no-pager", "relocd.service").splitlines()[-1]
    check(float(re.search(r"([0-9.]+) ", told.split(":")[1]).group(1)) <= 1.8, told.strip())
    status = pathlib.Path(f"/proc/{child('odometryd')}/status").read_text()
    check(re.search(r"CapBnd:\s+0+\n", status) and re.search(r"CapEff:\s+0+\n", status), "odometryd has no capability, and can get none")
    check("NoNewPrivs:\t1" in status and "Seccomp:\t2" in status, "and may not call what its filter forbids")
    scheduling = output_of("chrt", "-p", str(child("odometryd")))
    check("SCHED_FIFO" in scheduling and "priority: 20" in scheduling, "yet it runs with SCHED_FIFO, priority 20")


def crafted_datagrams():
    make_can()
    deploy()
    _make_outside()
    names = ("recorderd", "smootherd")
    before = {name: child(name) for name in names}
    _send_from_outside("10.9.9.1")
    time.sleep(1.0)
    check({name: child(name) for name in names} == before, "from another network they do not arrive: all daemons run on")

    send("239.255.76.67")
    wait_until(lambda: all(f"{name}: ended by SIG" in journal() for name in names), "from this machine they end who listens", 10)
    check(True, "from this machine they end who listens: " + "; ".join(line for line in journal().splitlines() if "ended by SIG" in line))
    wait_until(lambda: service("StatusText").startswith("4/4"), "relocd starts them again", 10)
    check(service("NRestarts") == "0", "relocd itself runs on, and has started them again")


def address_filter():
    """What the unit says of addresses keeps datagrams from other networks away, and nothing else does."""
    deploy()
    _make_outside()
    unit = pathlib.Path("/usr/lib/systemd/system/relocd.service").read_text()
    rules = re.findall(r"^IPAddress(?:Deny|Allow)=.*$", unit, re.MULTILINE)
    check(len(rules) == 2, f"the unit says {rules}")
    run("systemctl", "stop", "relocd")
    for properties, wanted in ((rules, "not heard"), ([], "heard")):
        listener = pathlib.Path(f"/run/systemd/system/listener-{len(properties)}.service")
        listener.write_text("\n".join(["[Service]", f"ExecStart={sys.executable} {__file__} listen", *properties, ""]))
        run("systemctl", "daemon-reload")
        run("systemctl", "start", listener.name)
        time.sleep(1.5)
        _send_from_outside("10.9.9.1")
        wait_until(lambda: service("SubState", listener.name) == "dead", "the listener has ended")
        said = output_of("journalctl", "--no-pager", "-o", "cat", f"_SYSTEMD_UNIT={listener.name}").strip()
        check(said == wanted, f"with {properties or 'no rules'} a datagram of another network is {said!r}")


def listen():
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("0.0.0.0", _PORT))
    listener.settimeout(4.0)
    try:
        listener.recvfrom(1 << 16)
        print("heard")
    except TimeoutError:
        print("not heard")


if __name__ == "__main__":
    listen() if sys.argv[1] == "listen" else send(sys.argv[1])
