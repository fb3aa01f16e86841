#!/usr/bin/env python3
"""Runs a program: prints.py PATTERN PROGRAM ARGUMENT... Fails if it fails, or if its output does not contain the pattern.

ctest's PASS_REGULAR_EXPRESSION ignores the exit status. As there, `.` also takes line ends."""
import re
import subprocess
import sys

done = subprocess.run(sys.argv[2:], stdout=subprocess.PIPE, text=True, check=False)
print(done.stdout, end="")
if done.returncode != 0:
    sys.exit(f"prints: the program ended with {done.returncode}")
if not re.search(sys.argv[1], done.stdout, re.DOTALL):
    sys.exit(f"prints: no {sys.argv[1]}")
