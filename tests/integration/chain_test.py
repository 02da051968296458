#!/usr/bin/env python3
"""chain_test.py SOURCE BUILD WORK CASE: the whole product as processes over LCM, on a generated street.

Runs in a network of its own (tests/integration/in_network). `setup` makes the data set, the map and the CAN log; `live` drives and leaves
its log for `replay` and `logplayer`; `kill` ends each child in turn; `messages` tries bad input on every program.
"""

import csv
import json
import os
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import sys
import time

SOURCE, BUILD, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
BIN = BUILD / "bin"
STREET = WORK / "street"
MAP = WORK / "street.relocmap"
CAN_LOG = WORK / "can0.log"
TRUTH = WORK / "truth_body.csv"
VEHICLE = SOURCE / "config/vehicles/differential_demo.yaml"
FRAMES = 150


def check_quietly(condition, what):
    if not condition:
        check(condition, what)


def run(*command, **options):
    print("+", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, **options)


def output_of(*command):
    return run(*command, stdout=subprocess.PIPE, text=True).stdout


def check(condition, what):
    print("ok  " if condition else "FAIL", what, flush=True)
    if not condition:
        sys.exit(1)


def setup():
    WORK.mkdir(parents=True, exist_ok=True)
    run(BIN / "make_street", STREET)
    run(BIN / "reloc", "sim", "wheels", "--trajectory", STREET / "planar_truth.csv", "--camera-forward-m", "1.03", "--config", VEHICLE,
        "--seed", "1", "--rate-hz", "100", "--out", CAN_LOG, "--truth", TRUTH)
    run(BIN / "reloc", "map", "train", "--dataset", STREET, "--split", STREET / "split_every5.txt", "--out", MAP, "--threads", os.cpu_count(),
        "--iterations", "400", "--views", "2")


def play(out, *beside):
    command = [SOURCE / "tools/play-dataset", "--bin", BIN, "--dataset", STREET, "--map", MAP, "--can", CAN_LOG, "--vehicle", VEHICLE, "--out", out]
    run(*command, *(["--", *beside] if beside else []))
    print((out / "relocd.log").read_text(), flush=True)
    logs = sorted((out / "log").glob("*.lcmlog"))
    check(logs, "the recorder left a log")
    return logs


def localization(log, out, channel="LOCALIZATION"):
    table = out / f"{channel}.csv"
    epoch = (WORK / "live/epoch_ns").read_text().strip() if not (out / "epoch_ns").exists() else (out / "epoch_ns").read_text().strip()
    run(BIN / "reloc", "log", "export", log, "--channel", channel, "--config", WORK / "live/robot.yaml", "--time-origin-ns", epoch, "--out", table)
    return table


def evaluate(table, *options):
    return json.loads(output_of(BIN / "reloc", "eval", "--truth", TRUTH, "--estimate", table, "--json", *options))


def mean_error_m(table):
    return evaluate(table)["position_m"]["mean"]


def check_report(log, out):
    """The report of the drive says what reloc eval, the log and the daemons say."""
    tables = {channel: localization(log, out, channel) for channel in ("ODOMETRY", "CAMERA_POSE", "LOCALIZATION")}
    run(BIN / "reloc", "report", "--title", "The generated street", "--truth", TRUTH, "--odometry", tables["ODOMETRY"], "--camera", tables["CAMERA_POSE"],
        "--fused", tables["LOCALIZATION"], "--log", log, "--time-origin-ns", (out / "epoch_ns").read_text().strip(), "--dataset", STREET,
        "--teach-dataset", STREET, "--out", out / "report")
    report = json.loads((out / "report/report.json").read_text())
    for row, table in (("camera", "CAMERA_POSE"), ("fused", "LOCALIZATION")):
        evaluation = evaluate(tables[table])
        check(report[row]["position_m"] == evaluation["position_m"], f"{row}: the report has reloc eval's errors of position")
        check(report[row]["heading_deg"] == evaluation["rotation_deg"], f"{row}: the report has reloc eval's errors of heading")
        check(report[row]["coverage"] == evaluation["coverage"], f"{row}: the report has reloc eval's coverage")
    aligned = evaluate(tables["ODOMETRY"], "--align")["aligned_position_m"]
    check(abs(report["odometry_aligned"]["position_m"]["mean"] - aligned["mean"]) < 1e-6, "aligned odometry is as good as reloc eval says")
    check(report["odometry"]["position_m"]["mean"] >= aligned["mean"], "odometry from the true start is no better than aligned")
    images = report["images"]
    check(images["worked_on"] == images["poses"] + sum(images["without_pose"].values()), "each image gave a pose or a reason")
    check(report["images_taken"] == FRAMES, "the report counts every image")
    check(abs(sum(report["status_share"].values()) - 1.0) < 1e-9, "the statuses' shares are all of the time")
    check(0.0 < report["latency_ms"]["can_to_pose"]["p50"] <= report["latency_ms"]["can_to_pose"]["p99"], "latencies are there and in order")
    page = (out / "report/report.html").read_text()
    check(page.count("data:image/png") == 4 and page.count("data:image/jpeg") == 16, "the page has its figures and both drives' images")


def live():
    out = WORK / "live"
    (log,) = play(out)
    print(output_of(BIN / "reloc", "log", "info", log), flush=True)
    channels = json.loads(output_of(BIN / "reloc", "log", "info", log, "--json"))["channels"]
    check(channels["IMAGE_front"]["events"] == FRAMES, "every image of the data set was published")
    check(all(channel["lost"] == 0 for channel in channels.values()), "no message was lost on any channel")
    check(channels["ODOMETRY"]["events"] >= 1491, "one ODOMETRY for each set of wheels in the CAN log")
    check(channels["LOCALIZATION"]["events"] == channels["ODOMETRY"]["events"], "one LOCALIZATION for each ODOMETRY")

    daemons = json.loads(output_of(BIN / "reloc", "log", "status", log, "--json"))["daemons"]
    inference = next(daemon for daemon in daemons if daemon["daemon"] == "inferenced")["values"]
    accounted = inference["images"] + inference["IMAGE_front_superseded"]
    check(accounted == FRAMES, f"inferenced accounts for every image: {inference['images']} seen, {inference['IMAGE_front_superseded']} superseded")
    check(inference["poses"] >= 0.3 * FRAMES, f"{inference['poses']} camera poses")

    error_m = mean_error_m(localization(log, out))
    check(error_m < 1.5, f"mean error of the live pose is {error_m:.3f} m")
    check_report(log, out)


def live_log():
    return sorted((WORK / "live/log").glob("*.lcmlog"))[0]


def replay():
    out = WORK / "replay"
    out.mkdir(exist_ok=True)
    for name in ("first", "second"):
        run(BIN / "reloc", "replay", "--log", live_log(), "--out", out / f"{name}.lcmlog", "--config", WORK / "live/robot.yaml",
            "--nodes", "odometry,inference,smoothing")
    check((out / "first.lcmlog").read_bytes() == (out / "second.lcmlog").read_bytes(), "two replays give the same bytes")
    error_m = mean_error_m(localization(out / "first.lcmlog", out))
    check(error_m < 1.5, f"mean error of the replayed pose is {error_m:.3f} m")


def log_events(path):
    """The events of a file in LCM's log format, as lists: [number, wall clock of the arrival in us, channel, bytes]."""
    data, place = path.read_bytes(), 0
    while place < len(data):
        sync, number, wall_us, channel_size, size = struct.unpack_from(">IqqII", data, place)
        check_quietly(sync == 0xEDA1DA01, f"{path} is whole at byte {place}")
        begin = place + 28 + channel_size
        yield [number, wall_us, data[begin - channel_size:begin].decode(), data[begin:begin + size]]
        place = begin + size


def with_wall_clock(body, change):
    """A message whose utime, which is the first field of all of ours, is `change` of what it was."""
    if len(body) < 16:  # LCM's own, to itself
        return body
    return body[:8] + struct.pack(">q", change(*struct.unpack_from(">q", body, 8))) + body[16:]


def clock_steps():
    """The wall clock steps by an hour, on and back, while the robot drives: replayed, the estimates are the same bit for bit."""
    out = WORK / "clock_steps"
    out.mkdir(exist_ok=True)
    events = list(log_events(live_log()))
    hour_us, third = 3_600_000_000, len(events) // 3
    step_us = [0] * third + [hour_us] * third + [-hour_us] * (len(events) - 2 * third)
    with open(out / "stepped.lcmlog", "wb") as stepped:
        for step, (number, wall_us, channel, body) in zip(step_us, events):
            body = with_wall_clock(body, lambda utime: utime + step)
            stepped.write(struct.pack(">IqqII", 0xEDA1DA01, number, wall_us + step, len(channel), len(body)) + channel.encode() + body)
    estimates = {}
    for name, log in (("steady", live_log()), ("stepped", out / "stepped.lcmlog")):
        run(BIN / "reloc", "replay", "--log", log, "--out", out / f"{name}.out.lcmlog", "--config", WORK / "live/robot.yaml",
            "--nodes", "odometry,inference,smoothing")
        estimates[name] = list(log_events(out / f"{name}.out.lcmlog"))
    same_but_wall = {name: [(channel, with_wall_clock(body, lambda utime: 0)) for _, _, channel, body in of_log] for name, of_log in estimates.items()}
    check(len(same_but_wall["steady"]) > 1000 and same_but_wall["steady"] == same_but_wall["stepped"],
          f"all {len(same_but_wall['steady'])} messages are the same but for the wall clock")
    steps = {struct.unpack_from(">q", b[3], 8)[0] - struct.unpack_from(">q", a[3], 8)[0] for a, b in zip(estimates["steady"], estimates["stepped"])}
    check({0, hour_us, -hour_us} <= steps, "which has stepped in them")


def logplayer():
    """The recorded images and odometry, played by LCM's own tool, drive inferenced and smootherd."""
    out = WORK / "logplayer"
    (out / "log").mkdir(parents=True, exist_ok=True)
    for old in (out / "log").glob("*"):
        old.unlink()
    options = ["--config", WORK / "live/robot.yaml", "--set", f"recorder.directory={out / 'log'}", "--set", "inference.max_image_age_ms=0",
               "--set", f"localization.state_file={out / 'smootherd.state'}"]
    daemons = [subprocess.Popen([str(word) for word in (BIN / name, *options)]) for name in ("recorderd", "smootherd", "inferenced")]
    time.sleep(3.0)
    urls = {"IMAGE_.*": "udpm://239.255.76.67:7668?ttl=0", "ODOMETRY": "udpm://239.255.76.67:7667?ttl=0"}
    players = [subprocess.Popen(["lcm-logplayer", "-e", channels, "-l", url, str(live_log())]) for channels, url in urls.items()]
    for player in players:
        player.wait()
    time.sleep(2.0)
    for daemon in reversed(daemons):
        daemon.send_signal(signal.SIGTERM)
        check(daemon.wait(timeout=10) == 0, "a daemon ends with 0 on SIGTERM")
    (log,) = (out / "log").glob("*.lcmlog")
    print(output_of(BIN / "reloc", "log", "info", log), flush=True)
    error_m = mean_error_m(localization(log, out))
    check(error_m < 1.5, f"mean error of the pose from lcm-logplayer is {error_m:.3f} m")


def subscriber():
    """A program of somebody else's, built against what relocd-dev installs, by CMake and by pkg-config, prints the recorded poses."""
    out = WORK / "subscriber"
    shutil.rmtree(out, ignore_errors=True)
    run("cmake", "--install", BUILD, "--component", "relocd-dev", env={**os.environ, "DESTDIR": str(out / "root")})
    prefix, example = out / "root/usr", out / "root/usr/share/doc/relocd-dev/examples"
    run("cmake", "-S", example, "-B", out / "build", f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", out / "build")
    flags = output_of("env", f"PKG_CONFIG_PATH={prefix / 'share/pkgconfig'}", f"PKG_CONFIG_SYSROOT_DIR={out / 'root'}",
                      "pkg-config", "--cflags", "--libs", "relocd-messages").split()
    run("c++", "-Wall", "-Wextra", "-Werror", "-o", out / "by_pkg_config", example / "print_pose.cc", *flags)
    for program in (out / "build/print_pose", out / "by_pkg_config"):
        printer = subprocess.Popen([program], stdout=subprocess.PIPE, text=True)
        time.sleep(0.5)
        run("lcm-logplayer", "-s", "10", "-e", "LOCALIZATION", "-l", "udpm://239.255.76.67:7667?ttl=0", live_log())
        time.sleep(0.5)
        printer.kill()
        poses = [line.split() for line in printer.communicate()[0].splitlines()]
        check(len(poses) > 500 and all(len(pose) == 6 for pose in poses), f"{program.name} prints {len(poses)} poses, the last {' '.join(poses[-1])}")


def child_pids(relocd):
    """The children's pids by name; camerad_front is called camerad."""
    children = {}
    for pid in pathlib.Path(f"/proc/{relocd}/task/{relocd}/children").read_text().split():
        try:
            children[pathlib.Path(f"/proc/{pid}/comm").read_text().strip()] = int(pid)
        except FileNotFoundError:
            pass
    return children


def kill_children():
    """Runs beside relocd: kills each child in turn, and writes how long each took to come back."""
    relocd = os.environ["RELOCD_PID"]
    time.sleep(5.0)
    threads = {name: len(os.listdir(f"/proc/{pid}/task")) for name, pid in child_pids(relocd).items()}
    (WORK / "kill/threads.json").write_text(json.dumps(threads))
    seconds = {}
    for name in ("recorderd", "odometryd", "camerad", "inferenced", "smootherd"):
        old = child_pids(relocd)[name]
        os.kill(old, signal.SIGKILL)
        begin = time.monotonic()
        while child_pids(relocd).get(name, old) == old and time.monotonic() - begin < 5.0:
            time.sleep(0.01)
        seconds[name] = time.monotonic() - begin
        time.sleep(1.2)
    (WORK / "kill/seconds.json").write_text(json.dumps(seconds))


def kill():
    out = WORK / "kill"
    out.mkdir(exist_ok=True)
    logs = play(out, sys.executable, __file__, SOURCE, BUILD, WORK, "kill_children")
    seconds = json.loads((out / "seconds.json").read_text())
    threads = json.loads((out / "threads.json").read_text())
    check(threads["odometryd"] == threads["camerad"] == 1, f"who only publishes has no thread of LCM's that takes all messages in: {threads}")
    for name, duration in seconds.items():
        check(duration < 1.0, f"{name} was killed and runs again after {duration:.2f} s")
    check(len(logs) == 2, "the recorder's second run began a file of its own")
    rows = []
    for log in logs:
        with open(localization(log, out)) as table:
            rows += [(int(row["time_ns"]), float(row["x_m"]), float(row["y_m"])) for row in csv.DictReader(table) if row["x_m"]]
    rows.sort()
    gaps_s = [(b[0] - a[0]) * 1e-9 for a, b in zip(rows, rows[1:])]
    check(max(gaps_s) < 1.5, f"the pose goes on: no gap above {max(gaps_s):.2f} s")
    check("continues from the saved pose" in (out / "relocd.log").read_text(), "smootherd goes on from the pose that it saved")
    error_m = mean_error_m(localization(logs[-1], out))
    check(error_m < 1.5, f"mean error through the other four kills is {error_m:.3f} m")


def expect_refusal(code, pattern, *command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=20)
    said = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else ""
    check(done.returncode == code and re.search(pattern, done.stderr), f"exit {done.returncode} (expected {code}): {said}")


def messages():
    """Bad input ends in one line that says what, where and what is allowed, and in an exit code that a script can use."""
    out = WORK / "messages"
    out.mkdir(exist_ok=True)

    def write(name, content):
        path = out / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    reloc, robot = BIN / "reloc", WORK / "live/robot.yaml"
    expect_refusal(78, r"broken.yaml: line \d+", reloc, "check-config", write("broken.yaml", "bus: {control_url: 'x\n"))
    expect_refusal(78, r"unknown.yaml: line 2: unknown key 'recorder.directry', did you mean 'directory'", BIN / "recorderd", "--config",
                   write("unknown.yaml", "recorder:\n  directry: /x\n"))
    expect_refusal(78, r"range.yaml: line 2: recorder.flush_s is -1, must be in", BIN / "relocd", "--config", write("range.yaml", "recorder:\n  flush_s: -1\n"))
    expect_refusal(2, r"--nonsense", BIN / "smootherd", "--nonsense")
    expect_refusal(2, r"mpa", reloc, "mpa")

    bytes_of_map = MAP.read_bytes()
    inferenced = [BIN / "inferenced", "--config", robot, "--set"]
    expect_refusal(78, r"missing.relocmap", *inferenced, f"inference.map_path={out / 'missing.relocmap'}")
    truncated = write("truncated.relocmap", bytes_of_map[: len(bytes_of_map) // 2])
    expect_refusal(78, r"truncated.relocmap", *inferenced, f"inference.map_path={truncated}")
    version = write("version.relocmap", bytes_of_map[:8] + b"\xff" + bytes_of_map[9:])
    expect_refusal(78, r"version.relocmap.*version", *inferenced, f"inference.map_path={version}")
    damaged = write("damaged.relocmap", bytes_of_map[:-100] + bytes(100))
    expect_refusal(78, r"damaged.relocmap", *inferenced, f"inference.map_path={damaged}")

    vehicle = VEHICLE.read_text()
    dbc = VEHICLE.with_name("differential_demo.dbc")
    no_signal = write("no_signal.yaml", vehicle.replace("differential_demo.dbc", str(write("no_signal.dbc", dbc.read_text().replace("\n SG_ ", "\n SG_ X")))))
    odometry = [reloc, "odometry", "--out", out / "odo.csv", "--config"]
    expect_refusal(78, r"no_signal.dbc: has no signal .*nearest are", *odometry, no_signal, "--can", CAN_LOG)
    expect_refusal(78, r"bad_candump.log: line 2", *odometry, VEHICLE, "--can", write("bad_candump.log", "(0.1) can0 1A0#00\nhello\n"))

    smooth = [reloc, "smooth", "--out", out / "est.csv", "--odometry"]
    odometry_csv = write("odometry.csv", "time_ns,dx_m,dy_m,dtheta_rad\n0,0,0,0\n100,1,0,0\n")
    fixes = "time_ns,x_m,y_m\n"
    expect_refusal(78, r"window_keyframes is 1, must be in \[2, 5000\]", *smooth, odometry_csv, "--fixes", write("fixes.csv", fixes + "0,0,0\n"), "--window", "1")
    expect_refusal(78, r"header.csv: line 1: the header has no column 'x_m'", *smooth, odometry_csv, "--fixes", write("header.csv", "time_ns,x,y\n0,0,0\n"))
    expect_refusal(78, r"nan.csv: line 3: x_m is 'nan'", *smooth, odometry_csv, "--fixes", write("nan.csv", fixes + "0,0,0\n50,nan,0\n"))
    expect_refusal(78, r"order.csv: line 3", *smooth, write("order.csv", "time_ns,dx_m,dy_m,dtheta_rad\n100,0,0,0\n50,1,0,0\n"), "--fixes",
                   write("fixes.csv", fixes + "0,0,0\n"))


if __name__ == "__main__":
    globals()[sys.argv[4]]()
