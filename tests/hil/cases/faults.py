"""Faults of a robot's devices, processes and machine, with the real kernel and systemd: what breaks, and how soon it is well again."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import time

import machine
from machine import (CONFIG, Wheels, check, child, deploy, drive, journal, longest_gap_s, make_can, run, service, start, statuses, times_of, wait_until)


def _stop():
    """The recorder's files are complete after this."""
    begin = time.monotonic()
    run("systemctl", "stop", "relocd")
    return time.monotonic() - begin


def _drive_wheels():
    make_can()
    deploy()
    wheels = Wheels()
    wheels.start()
    wait_until(lambda: len(wheels.sent_ns) > 100, "frames go onto the bus")
    return wheels


def _check_bus_came_back(wheels, back_ns, pid):
    """The bus works again since `back_ns`; odometry does soon after the first frame, in the same process."""
    wait_until(lambda: wheels.sent_ns[-1] > back_ns, "frames go onto the bus again")
    first_ns = next(sent_ns for sent_ns in wheels.sent_ns if sent_ns > back_ns)
    time.sleep(1.0)
    check(child("odometryd") == pid, "odometryd is the same process")
    _stop()
    fresh = [time_ns for time_ns in times_of("CAN_can0") if time_ns >= first_ns]
    check(fresh, "frames arrive again")
    check((fresh[0] - first_ns) * 1e-9 < 0.2, f"frames arrive {(fresh[0] - first_ns) * 1e-6:.0f} ms after the first one that was sent")
    gap_s = longest_gap_s(times_of("LOCALIZATION"))
    check(gap_s < 0.5, f"LOCALIZATION never stops: its longest gap is {gap_s:.2f} s")


def can_down_up():
    wheels, pid = _drive_wheels(), child("odometryd")
    run("ip", "link", "set", "can0", "down")
    time.sleep(1.5)
    said = statuses()["odometryd"]
    check(said["level"] != "OK", f"the status says so: {said['message']}")
    back_ns = time.monotonic_ns()
    run("ip", "link", "set", "can0", "up")
    _check_bus_came_back(wheels, back_ns, pid)


def can_deleted_and_made_again():
    wheels, pid = _drive_wheels(), child("odometryd")
    run("ip", "link", "del", "can0")
    time.sleep(1.5)
    back_ns = time.monotonic_ns()
    make_can()
    _check_bus_came_back(wheels, back_ns, pid)


def can_error_frames():
    wheels = _drive_wheels()
    before = statuses()["odometryd"]["values"]
    for _ in range(50):
        run("cansend", "can0", "20000040#0000000000000000", stdout=subprocess.DEVNULL)  # bus-off
        run("cansend", "can0", "20000004#0010000000000000", stdout=subprocess.DEVNULL)  # controller: receiver error passive
    said = statuses()["odometryd"]
    print(said, flush=True)
    counted = said["values"]["can_error_frames"] - before["can_error_frames"]
    check(counted == 100, f"{counted:.0f} of 100 error frames are counted")
    check(wheels.is_alive() and said["level"] != "ERROR", "and odometry goes on")
    _stop()
    gap_s = longest_gap_s(times_of("ODOMETRY"))
    check(gap_s < 0.5, f"its longest gap is {gap_s:.2f} s")


def can_babbling_node():
    wheels = _drive_wheels()
    received = pathlib.Path("/sys/class/net/can0/statistics/rx_packets")
    babble = pathlib.Path("/tmp/babble.log")  # 8000 frames/s
    babble.write_text("".join(f"({i / 8000:.6f}) can0 7FF#0011223344556677\n" for i in range(60_000)))
    babbler = start("canplayer", "-I", babble, "-g", "5")
    count, begin, begin_ns = int(received.read_text()), time.monotonic(), time.monotonic_ns()
    time.sleep(5.0)
    rate = (int(received.read_text()) - count) / (time.monotonic() - begin)
    end_ns = time.monotonic_ns()
    babbler.kill()
    values = statuses()["odometryd"]["values"]
    _stop()
    sent = sum(begin_ns <= sent_ns < end_ns for sent_ns in wheels.sent_ns)
    made = sum(begin_ns <= time_ns < end_ns for time_ns in times_of("ODOMETRY"))
    check(rate > 5000, f"{rate:.0f} frames/s are on the bus")
    check(made >= 0.98 * sent, f"{made} ODOMETRY of {sent} wheel frames meanwhile")
    check(values["can_received"] < 2 * len(wheels.sent_ns), "foreign frames do not wake odometryd: the kernel keeps them away")


def _feed(pixel_format="MJPG"):
    """@return the player of images, and CLOCK_MONOTONIC of the first one."""
    first_ns = time.monotonic_ns() + 1_500_000_000
    return start("env", f"RELOCD_PLAYBACK_EPOCH_NS={first_ns}", "reloc", "sim", "play", "--dataset", drive(), "--live-video", "/dev/video0",
                 "--pixel-format", pixel_format, stdout=subprocess.DEVNULL), first_ns


def _with_camera():
    make_can()
    deploy()
    player, first_ns = _feed()
    wait_until(lambda: statuses()["camerad_front"]["values"]["frames"] > 5, "images come", 15)
    return player, first_ns


def _end(player):
    player.send_signal(signal.SIGKILL)
    player.wait()


def _check_camera_came_back(first_ns, pid):
    time.sleep(4.0)
    check(child("camerad") == pid, "camerad is the same process")
    _stop()
    images = [time_ns for time_ns in times_of("IMAGE_front") if time_ns >= first_ns]
    check(images, "images come again")
    back_s = (images[0] - first_ns) * 1e-9
    check(back_s < 1.0, f"the camera is back {back_s:.2f} s after it gives images")


def camera_writer_stops():
    player, _ = _with_camera()
    pid = child("camerad")
    _end(player)
    time.sleep(3.0)
    said = statuses()["camerad_front"]
    check(said["level"] != "OK", f"the status says so: {said['message']}")
    _check_camera_came_back(_feed()[1], pid)


def camera_changes_its_format():
    player, _ = _with_camera()
    pid = child("camerad")
    _end(player)
    # The loopback device keeps its format for as long as it is open.
    wait_until(lambda: "capabilities" in statuses()["camerad_front"]["message"], "camerad lets the device go")
    _check_camera_came_back(_feed("YUYV")[1], pid)


def camera_removed_and_back():
    player, _ = _with_camera()
    pid = child("camerad")
    _end(player)
    wait_until(lambda: subprocess.run(["rmmod", "v4l2loopback"], stderr=subprocess.DEVNULL).returncode == 0, "the driver is unloaded", 10)
    check(not os.path.exists("/dev/video0"), "the camera's node is gone")
    time.sleep(1.0)
    said = statuses()["camerad_front"]
    check("No such file" in said["message"], f"the status says so: {said['message']}")
    run("modprobe", "v4l2loopback", "video_nr=0", "exclusive_caps=1", "max_buffers=8")
    run("chgrp", "video", "/dev/video0")
    os.chmod("/dev/video0", 0o660)
    _check_camera_came_back(_feed()[1], pid)


def one_of_two_cameras_unplugged():
    """Both are named by links that stay the same, as udev makes them in /dev/v4l/by-id."""
    links = pathlib.Path("/dev/v4l/by-id")
    links.mkdir(parents=True)
    for number, name in enumerate(("front", "rear")):
        (links / name).symlink_to(f"/dev/video{number}")
    shipped = (machine.SOURCE / "packaging/robot.yaml").read_text()
    two = shipped.replace("    device: /dev/video0 ", "    device: /dev/v4l/by-id/front ").replace(
        "\ncan:\n", "  rear:\n    device: /dev/v4l/by-id/rear\n\ncan:\n")
    make_can()
    deploy(config=two, ready="5/5")
    players = [start("reloc", "sim", "play", "--dataset", drive(), "--live-video", f"/dev/video{number}", stdout=subprocess.DEVNULL) for number in (0, 1)]

    def frames():
        return {name: said["values"]["frames"] for name, said in statuses().items() if name.startswith("camerad_")}
    wait_until(lambda: len(frames()) == 2 and min(frames().values()) > 5, "images come from both", 20)
    _end(players[1])
    (links / "rear").unlink()
    time.sleep(2.0)
    said = statuses()
    check(said["camerad_rear"]["level"] == "ERROR" and said["camerad_front"]["level"] == "OK", f"one is gone: {said['camerad_rear']['message']}")
    before = frames()
    time.sleep(1.0)
    after = frames()
    check(after["camerad_front"] > before["camerad_front"], "the other goes on")
    # It comes back under another number.
    _end(players[0])
    wait_until(lambda: "capabilities" in statuses()["camerad_front"]["message"], "camerad lets the device go")
    (links / "front").unlink()
    (links / "rear").symlink_to("/dev/video0")
    start("reloc", "sim", "play", "--dataset", drive(), "--live-video", "/dev/video0", stdout=subprocess.DEVNULL)
    wait_until(lambda: frames()["camerad_rear"] > after["camerad_rear"] + 5, "it is found by its link, under another number", 15)


def _ready_times_s(name):
    """CLOCK_MONOTONIC at which relocd said that a daemon is ready, each time."""
    said = subprocess.run(["journalctl", "--no-pager", "-u", "relocd", "-o", "json", "--output-fields=MESSAGE"], stdout=subprocess.PIPE, text=True).stdout
    entries = map(json.loads, said.splitlines())
    return [int(entry["__MONOTONIC_TIMESTAMP"]) * 1e-6 for entry in entries if f"{name}: ready " in str(entry["MESSAGE"])]


def _wait_until_ready(name, begin_s, timeout_s):
    """@return how long after `begin_s`, by the journal's time. Looking costs the guest's one CPU 0.1 s, so it is not done often."""
    wait_until(lambda: (_ready_times_s(name) or [0])[-1] > begin_s, f"{name} is ready again", timeout_s, 0.5)
    return _ready_times_s(name)[-1] - begin_s


def _disturb_each(number, limits_s, said):
    """Sends a signal to each daemon in turn, and checks how long each takes to be ready again."""
    for name, limit_s in limits_s.items():
        pid, begin_s = child("camerad" if name.startswith("camerad") else name), time.monotonic()
        check(pid > 0, f"{name} runs")
        os.kill(pid, number)
        seconds = _wait_until_ready(name, begin_s, limit_s + 5)
        check(seconds < limit_s, f"{name}: {said}, ready again after {seconds:.2f} s")


def daemons_killed():
    _drive_wheels()
    # 0.1 s of each are the supervisor's pause. Starting a program costs the guest several times what it costs a robot.
    _disturb_each(signal.SIGKILL, {"recorderd": 0.7, "smootherd": 0.7, "odometryd": 0.7, "camerad_front": 0.7}, "killed")
    check(service("NRestarts") == "0" and service("ActiveState") == "active", "relocd ran on")
    _stop()
    gap_s = longest_gap_s(times_of("LOCALIZATION"))
    check(gap_s < 1.5, f"LOCALIZATION: its longest gap is {gap_s:.2f} s")


def daemons_hang():
    _drive_wheels()
    _disturb_each(signal.SIGSTOP, {"recorderd": 11.7, "smootherd": 3.7, "odometryd": 3.7, "camerad_front": 3.7}, "stopped")
    hung = [line for line in journal().splitlines() if "no sign of life" in line]
    noticed_s = [float(line.split("life for ")[1].split(" s")[0]) for line in hung]
    # The recorder first: it has 10 s, for a slow disk.
    check(len(hung) == 4 and noticed_s[0] < 11.0 and max(noticed_s[1:]) < 3.0, f"noticed after {noticed_s} s")


def daemons_killed_all_at_once():
    _drive_wheels()
    names = ("recorderd", "smootherd", "odometryd", "camerad_front")
    begin_s = time.monotonic()
    for pid in [child("camerad" if name.startswith("camerad") else name) for name in names]:
        os.kill(pid, signal.SIGKILL)
    slowest_s = max(_wait_until_ready(name, begin_s, 10) for name in names)
    check(slowest_s < 3.0, f"all are ready again after {slowest_s:.2f} s")


def supervisor_killed():
    _drive_wheels()
    run("reloc", "set-pose", "1", "2", "0.5")
    wait_until(lambda: os.path.exists("/run/relocd/smootherd.state"), "smootherd keeps its pose")
    main, begin = service("MainPID"), time.monotonic()
    os.kill(int(main), signal.SIGKILL)
    wait_until(lambda: service("NRestarts") == "1" and service("SubState") == "running", "systemd starts it again", 10)
    check(True, f"ready again after {time.monotonic() - begin:.2f} s")
    wait_until(lambda: service("StatusText").startswith("4/4"), "all daemons are ready", 10)
    names = subprocess.run(["ps", "-o", "comm=", "-u", "relocd"], stdout=subprocess.PIPE, text=True).stdout.split()
    check(sorted(names) == ["camerad", "odometryd", "recorderd", "relocd", "smootherd"], f"each daemon is there once: {names}")
    wait_until(lambda: "begins at the saved pose" in journal(), "smootherd goes on from the pose that it saved")


def supervisor_hangs():
    _drive_wheels()
    main, begin = service("MainPID"), time.monotonic()
    os.kill(int(main), signal.SIGSTOP)
    wait_until(lambda: service("NRestarts") == "1" and service("SubState") == "running", "systemd starts it again", 15)
    check(time.monotonic() - begin < 8.0, f"its watchdog of 5 s expired, it is ready again after {time.monotonic() - begin:.2f} s")
    check("Failed with result 'watchdog'" in journal(), "the journal says why")
    wait_until(lambda: service("StatusText").startswith("4/4"), "all daemons are ready", 10)


def restart_reload_stop():
    _drive_wheels()
    begin = time.monotonic()
    run("systemctl", "restart", "relocd")
    check(time.monotonic() - begin < 3.0 + 11.0, f"restart takes {time.monotonic() - begin:.2f} s")
    run("systemctl", "stop", "relocd")
    begin = time.monotonic()
    run("systemctl", "start", "relocd")  # returns at READY
    check(time.monotonic() - begin < 3.0, f"READY {time.monotonic() - begin:.2f} s after the unit starts")
    wait_until(lambda: service("StatusText").startswith("4/4"), "all daemons are ready", 10)
    before = {name: child(name) for name in ("recorderd", "smootherd", "odometryd", "camerad")}
    CONFIG.write_text(CONFIG.read_text().replace("track_m: 1.5", "track_m: 1.6"))
    run("systemctl", "reload", "relocd")
    wait_until(lambda: child("odometryd") not in (0, before["odometryd"]), "odometryd is started again")
    changed = [name for name, pid in before.items() if child(name) != pid]
    check(changed == ["odometryd"], f"a reload starts again only what changed: {changed}")
    good = CONFIG.read_text()
    CONFIG.write_text(good + "nonsense: 1\n")
    run("systemctl", "reload", "relocd")
    wait_until(lambda: "unknown key 'nonsense'" in journal(), "a bad config is refused by name")
    check(service("ActiveState") == "active" and child("odometryd") > 0, "and all goes on as it was")
    CONFIG.write_text(good)
    seconds = _stop()
    check(seconds < 11.0 and service("Result") == "success", f"stopped within {seconds:.2f} s, result {service('Result')}")


def clock_steps():
    _drive_wheels()
    before = statuses()["odometryd"]["values"]
    begin_ns = time.monotonic_ns()
    for step in ("+1 hour", "-2 hours", "+1 hour"):
        run("date", "-s", step, stdout=subprocess.DEVNULL)
        time.sleep(2.0)
    end_ns = time.monotonic_ns()
    said = statuses()["odometryd"]
    _stop()
    times = [time_ns for time_ns in times_of("ODOMETRY") if begin_ns <= time_ns < end_ns]
    check(all(a <= b for a, b in zip(times, times[1:])), "the measurements' times only go forward")
    gap_s = longest_gap_s(times)
    check(len(times) > 500 and gap_s < 0.2, f"{len(times)} ODOMETRY in 6 s, the longest gap {gap_s:.3f} s")
    kept = {name: said["values"][name] - before[name] for name in ("gaps", "jumps", "guesses", "out_of_order")}
    check(not any(kept.values()), f"odometry saw nothing of it: {kept}")
    poses = [time_ns for time_ns in times_of("LOCALIZATION") if begin_ns <= time_ns < end_ns]
    check(poses == times, f"{len(poses)} LOCALIZATION, each of the time of its ODOMETRY")


def disk_full():
    make_can()
    pathlib.Path("/var/log/relocd").mkdir(parents=True, exist_ok=True)
    run("mount", "-t", "tmpfs", "-o", "size=5m,mode=0777", "tmpfs", "/var/log/relocd")
    deploy("recorder: {segment_mb: 1, min_free_mb: 1, max_total_mb: 1000, flush_s: 0.2}\n")
    wheels = Wheels()
    wheels.start()
    player, _ = _feed()
    def values():
        return statuses()["recorderd"]["values"]
    wait_until(lambda: values()["segments_deleted"] > 2, "the oldest files are deleted to make room", 60)
    pid = child("recorderd")
    # Again and again, since the recorder deletes its own files to make room.
    start("sh", "-c", "for i in $(seq 40); do head -c 5000000 /dev/zero >>/var/log/relocd/of_somebody_else; sleep 0.1; done", stderr=subprocess.DEVNULL)
    wait_until(lambda: statuses()["recorderd"]["level"] != "OK", "the recorder says that the disk is full", 15)
    said = statuses()["recorderd"]
    check(True, f"the status says so: {said['message']}, {said['values']['dropped_events']:.0f} events dropped")
    check(child("recorderd") == pid, "it runs on")
    wait_until(lambda: subprocess.run(["pgrep", "-x", "head"]).returncode != 0, "nobody writes any more")
    time.sleep(4.0)
    pathlib.Path("/var/log/relocd/of_somebody_else").unlink()
    wait_until(lambda: statuses()["recorderd"]["level"] == "OK", "it recovers once there is room", 15)
    before = values()["events"]
    wait_until(lambda: values()["events"] > before, "and records again")
    check(child("recorderd") == pid and service("NRestarts") == "0", "in the same process")


def inference_out_of_memory():
    make_can()
    pathlib.Path("/var/lib/relocd/maps").mkdir(parents=True, exist_ok=True)
    shutil.copy(machine.SOURCE / "config/maps/campus.relocmap", "/var/lib/relocd/maps/site.relocmap")
    deploy(inference=True)
    wheels = Wheels()
    wheels.start()
    pids = {name: child(name) for name in ("recorderd", "smootherd", "odometryd", "camerad", "inferenced")}
    # The kernel's own out-of-memory killer, and whom it finds first.
    pathlib.Path(f"/proc/{pids['inferenced']}/oom_score_adj").write_text("1000")
    pathlib.Path("/proc/sysrq-trigger").write_text("f")
    wait_until(lambda: "inferenced: ended by SIGKILL" in journal(), "inferenced is killed for memory", 20)
    wait_until(lambda: "oom_kill 1" in pathlib.Path("/sys/fs/cgroup/system.slice/relocd.service/memory.events").read_text(), "systemd is told")
    wait_until(lambda: service("StatusText").startswith("5/5"), "it is ready again", 30)
    check(service("NRestarts") == "0" and service("ActiveState") == "active", "the service was not stopped for it")
    same = [name for name in ("recorderd", "smootherd", "odometryd", "camerad") if child(name) == pids[name]]
    check(len(same) == 4, f"all others ran on: {same}")
    _stop()
    gap_s = longest_gap_s(times_of("LOCALIZATION"))
    check(gap_s < 0.6, f"LOCALIZATION never stops: its longest gap is {gap_s:.2f} s")
