"""Runs a command; prints all that was heard over LCM meanwhile, as JSON: [[channel, payload in hexadecimal], ...]."""

from __future__ import annotations

import json
import subprocess
import sys

import lcm
from stance.network import LCM_URL

QUIET = 500  # ms without a message after the command's end


def main() -> int:
    connection = lcm.LCM(LCM_URL)
    heard: list[tuple[str, str]] = []
    connection.subscribe(".*", lambda channel, data: heard.append((channel, data.hex()))).set_queue_capacity(0)
    command = subprocess.Popen(sys.argv[1:], stdout=sys.stderr)
    while command.poll() is None or connection.handle_timeout(QUIET):
        connection.handle_timeout(20)
    print(json.dumps(heard))
    return command.returncode


if __name__ == "__main__":
    sys.exit(main())
