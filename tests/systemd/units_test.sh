#!/usr/bin/env bash
# Checks the installed units as systemd reads them, and how much of the machine they leave open.
#
#   units_test.sh BUILD_DIR PREFIX SOURCE_DIR
#
# Exit 77 (skipped) where systemd's tools are missing.
set -euo pipefail

build=$1 prefix=$2 source=$3
max_exposure=18  # tenths: 1.8 of 10, a unit without any sandbox has 9.6

if ! command -v systemd-analyze >/dev/null; then
  echo "skipped: systemd-analyze is not installed (apt-get install systemd)"
  exit 77
fi
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT

install -D -m 644 -t "$root/units" "$build/systemd/relocd.service" "$source/systemd/relocd-lcm-route.service"
# What is not installed here stands where the unit will find it.
sed -i "s,$prefix/bin/relocd,$build/bin/relocd," "$root/units/relocd.service"

echo "-- verify"
SYSTEMD_UNIT_PATH="$root/units:" systemd-analyze verify --man=no "$root/units/relocd.service" "$root/units/relocd-lcm-route.service" \
  2>&1 | tee "$root/verify.log"
if grep -E "$root/units|relocd" "$root/verify.log"; then
  echo "failed: systemd-analyze verify complains about our units"
  exit 1
fi

echo "-- security"
for unit in relocd relocd-lcm-route; do
  systemd-analyze security --offline=true --no-pager --threshold=$max_exposure "$root/units/$unit.service" >"$root/security.log" || {
    cat "$root/security.log"
    echo "failed: $unit.service is more exposed than $max_exposure tenths"
    exit 1
  }
  tail -1 "$root/security.log"
done

echo "-- every system call that SCHED_FIFO, process groups and pidfds need is let through"
denied=$(systemd-analyze syscall-filter --no-pager @privileged)
allowed=$(for set in $(systemd-analyze syscall-filter --no-pager @system-service | grep -oE '@[a-z-]+' | sort -u); do
  systemd-analyze syscall-filter --no-pager "$set"
done)
for call in sched_setscheduler setpriority setrlimit setpgid prctl pidfd_open close_range kill flock; do
  grep -qwE "^ +$call" <<<"$allowed" || { echo "failed: $call is not in @system-service"; exit 1; }
  ! grep -qwE "^ +$call" <<<"$denied" || { echo "failed: $call is in @privileged"; exit 1; }
done

echo "-- accounts and folders"
if command -v systemd-sysusers >/dev/null; then
  mkdir -p "$root/etc"
  systemd-sysusers --root="$root" --inline 'g video 44' >/dev/null
  systemd-sysusers --root="$root" - <"$source/systemd/relocd.sysusers.conf"
  grep -q '^relocd:' "$root/etc/passwd"
  grep -qE '^video:.*relocd' "$root/etc/group"
fi
if command -v systemd-tmpfiles >/dev/null && [[ $EUID -eq 0 ]]; then
  systemd-tmpfiles --root="$root" --create "$source/systemd/relocd.tmpfiles.conf"
  [[ -d $root/var/lib/relocd/maps && -d $root/var/log/relocd ]]
fi
echo ok
