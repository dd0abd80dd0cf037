"""What the scripts that fly manifests share: which program flies, and a flight that is tried again where the host broke it."""

import json
import os
import subprocess
import sys

ROOT = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
# A run that the watchdog ended on a host that was too busy to start it is no verdict: it is tried again.
TRIES = 3


class Refused(SystemExit):
    """A run that was not flown, and what the program said: it ends a script that does not care."""


def program():
    """The program: HUMMINGBUS of the environment, or the one that is built here, release first."""
    built = (os.path.join(ROOT, "target", profile, "hummingbus") for profile in ("release", "debug"))
    found = os.environ.get("HUMMINGBUS") or next(filter(os.path.exists, built), None)
    return found or sys.exit(f"{sys.argv[0]}: there is no program: build it with cargo build --release")


def fly(manifest, recording, settings=(), more=()):
    """Flies `manifest` with `settings`, KEY=VALUE each, and `more` arguments; the summary that it prints as JSON, whether or
    not its conditions held."""
    command = [program(), "run", manifest, "--json", "--record", recording, *more]
    command += [part for setting in settings for part in ("--set", setting)]
    for _ in range(TRIES):
        flown = subprocess.run(command, capture_output=True, text=True, check=False)
        if flown.returncode in (0, 1):
            return json.loads(flown.stdout)
        if "watchdog" not in flown.stderr:
            break
        print(f"{manifest}: {flown.stderr.strip()}; tried again", file=sys.stderr)
    raise Refused(f"{' '.join(command)}\n{flown.stderr.strip()}")
