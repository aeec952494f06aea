"""Runs a command in bounds and says what it held: `python bounded.py FILE SECONDS COMMAND ...`.

A process of its own, as what a process held before it became another program counts as that
program's: a child of pytest has held all that pytest holds.
"""

import os
import resource
import subprocess
import sys

if __name__ == "__main__":
    seconds = int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    process = subprocess.Popen(sys.argv[3:])
    _, status, used = os.wait4(process.pid, 0)
    with open(sys.argv[1], "w") as file:
        file.write(str(used.ru_maxrss * 1024))
    code = os.waitstatus_to_exitcode(status)
    sys.exit(code if code >= 0 else 128 - code)
