#!/usr/bin/env python3
"""run_case.py SOURCE BUILD TOPIC.NAME: runs the function NAME of cases/TOPIC.py on this machine, which is the guest of guest/boot.

Exit code 0 when every check held. A case changes the machine as it likes: nothing of it outlives the guest.
"""

import importlib
import pathlib
import sys
import traceback

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))

import machine  # noqa: E402

machine.SOURCE, machine.BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
topic, name = sys.argv[3].split(".")
try:
    getattr(importlib.import_module(f"cases.{topic}"), name)()
except machine.Failure as failure:
    print("FAIL", failure, flush=True)
except Exception:
    traceback.print_exc()
else:
    sys.exit(0)
finally:
    machine.end_processes()
machine.print_journal()
sys.exit(1)
