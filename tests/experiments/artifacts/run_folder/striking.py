"""Commands that are struck down by a signal at a place of their own code."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[4]


WORDS = ["explore", "paper-fig4", "--seed", "2", "--no-sweep"]


STRUCK = """
import os, signal, sys
from contextlib import contextmanager
from types import SimpleNamespace
from chainslam.experiments.artifacts import running_log
from chainslam.experiments.commands import cli, replay

place, number, nth = sys.argv.pop(1), int(sys.argv.pop(1)), int(sys.argv.pop(1))
# Under nohup a process is born deaf to SIGHUP.
signal.signal(signal.SIGHUP, signal.SIG_DFL)

def strike(*_):
    global nth
    nth -= 1
    if not nth:
        os.kill(os.getpid(), number)

def before(owner, name):
    act = getattr(owner, name)
    def struck(*arguments):
        strike()
        return act(*arguments)
    setattr(owner, name, struck)

@contextmanager
def strikes(title, steps):
    yield strike

if place == "step":
    before(running_log.RunningLog, "add")
elif place == "torn":
    write = os.write
    def torn(descriptor, content):
        if descriptor <= 2:
            return write(descriptor, content)
        if nth == 1:
            write(descriptor, content[:700])
        strike()
        return write(descriptor, content)
    running_log.os = SimpleNamespace(**vars(os) | {"write": torn})
elif place == "file":
    before(os, "fsync")
elif place == "removed":
    before(running_log.RunningLog, "remove")
elif place == "replay":
    replay.progress = strikes
sys.exit(cli.main())
"""
"""The command, which sends itself a signal at the nth time that it comes to a place."""


def struck(place, number, nth, folder, *words):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", STRUCK, place, str(int(number)), str(nth), *(words or WORDS)]
    limits = [] if words else ["--max-steps", "8", "--out", str(folder)]
    return subprocess.run([*command, *limits], env=environment, capture_output=True, text=True)


def parts(folder):
    return [path.name for path in folder.rglob("*") if path.name.endswith(".part")]
