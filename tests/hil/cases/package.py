"""The Debian packages: installed, upgraded, purged."""

import grp
import json
import os
import pathlib
import pwd
import subprocess
import tempfile

from machine import check, dpkg, install, journal, make_can, output_of, packages, run, service, wait_until

CONFIG = pathlib.Path("/etc/relocd/robot.yaml")


def _files_below(*folders):
    return {str(path) for folder in folders for path in pathlib.Path(folder).rglob("*")}


def _newer_version(folder):
    """The package relocd as a later version, with another shipped config."""
    unpacked = pathlib.Path(folder) / "unpacked"
    run("dpkg-deb", "-R", packages()["relocd"], unpacked)
    control = unpacked / "DEBIAN/control"
    control.write_text(control.read_text().replace("\nVersion: ", "\nVersion: 9."))
    shipped = unpacked / "etc/relocd/robot.yaml"
    shipped.write_text(shipped.read_text() + "# of a later version\n")
    package = pathlib.Path(folder) / "relocd.deb"
    run("dpkg-deb", "-b", unpacked, package, stdout=subprocess.DEVNULL)
    return package


def install_upgrade_purge():
    places = ("/etc", "/run/systemd/system", "/usr/lib/systemd", "/var/lib", "/var/log")
    # What account tools and the package manager keep for themselves.
    ours_not = ("/etc/passwd", "/etc/group", "/etc/shadow", "/etc/gshadow", "/etc/subuid", "/etc/subgid", "/var/log/dpkg.log", "/var/lib/dpkg/")
    before = _files_below(*places)
    make_can()
    install("relocd", "relocd-tools", "relocd-dev")
    check(service("ActiveState") == "active", "the service runs once it is installed")
    check(service("UnitFileState") == "enabled", "and at every boot")
    check(service("User") == "relocd" and pwd.getpwnam("relocd").pw_shell.endswith("nologin"), "as its own user, who cannot log in")
    check("relocd" in grp.getgrnam("video").gr_mem, "who may open cameras")
    route = output_of("ip", "route", "show", "239.255.76.0/24")
    check("dev lo" in route, f"LCM's messages go to lo: {route.strip()}")
    check(pathlib.Path("/proc/sys/net/core/rmem_max").read_text().strip() == "4194304", "receive buffers may be as large as images need")
    # As it is shipped: no map and no camera, but odometry and smoothing.
    wait_until(lambda: "inferenced FAILED" in service("StatusText"), "the missing map is noticed", 15)
    wait_until(lambda: service("StatusText") == "4/5 ready; inferenced FAILED (exit code 78)", "all but inference are ready", 5)
    check(True, f"what is missing is said: {service('StatusText')}")
    check("/var/lib/relocd/maps/site.relocmap: No such file" in journal(), "and why, in the journal")
    check(oct(os.stat("/dev/video0").st_mode & 0o777) == "0o660" and grp.getgrgid(os.stat("/dev/video0").st_gid).gr_name == "video",
          "cameras belong to group video")
    said = subprocess.run(["reloc", "doctor", "--json"], stdout=subprocess.PIPE, text=True)
    missing = {check["name"]: check["command"] for check in json.loads(said.stdout)["checks"] if not check["ok"]}
    # The guest has no time server, its disk is a part of its small memory, and nobody made a map.
    check(said.returncode == 1 and set(missing) - {"disk"} == {"map", "clock"}, f"reloc doctor says what is missing: {missing}")
    for page in ("8 relocd", "1 reloc", "1 reloc-map", "1 reloc-status", "8 odometryd"):
        check(output_of("man", "-w", *page.split()).strip().endswith(".gz"), f"man {page}")
    completed = output_of("bash", "-c", ". /usr/share/bash-completion/completions/reloc; COMP_WORDS=(reloc st); COMP_CWORD=1; _reloc; echo ${COMPREPLY[*]}")
    check(completed.strip() == "status", "bash completes verbs")

    CONFIG.write_text(CONFIG.read_text() + "# by the operator\n")
    with tempfile.TemporaryDirectory() as folder:
        dpkg("-i", _newer_version(folder))
    check(CONFIG.read_text().endswith("# by the operator\n"), "an upgrade keeps an edited config")
    shipped = CONFIG.with_name("robot.yaml.dpkg-dist")
    check(shipped.read_text().endswith("# of a later version\n"), "and puts the new one beside it")
    check(service("ActiveState") == "active" and output_of("dpkg-query", "-W", "-f", "${Version}", "relocd").startswith("9."), "the new version runs")

    files = [path for path in output_of("dpkg", "-L", "relocd", "relocd-tools", "relocd-dev").split() if os.path.isfile(path)]
    dpkg("--remove", "relocd-tools", "relocd-dev", "relocd")
    check(service("ActiveState") == "inactive", "removed: it does not run any more")
    check(CONFIG.exists(), "but the config is there")
    dpkg("--purge", "relocd-tools", "relocd-dev", "relocd")
    check(not [path for path in files if os.path.exists(path)], f"purged: none of {len(files)} files is left")
    left = sorted(path for path in _files_below(*places) - before if not path.startswith(ours_not))
    check(not left, f"nothing that it made is left: {left}")
    check(not [user for user in pwd.getpwall() if user.pw_name == "relocd"], "its user is gone")
