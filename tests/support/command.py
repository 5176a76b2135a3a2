"""The command line, and the files that it reads and writes."""

import subprocess
import sys

from screwgauge.cli import GROUPS, main
from screwgauge.cli import _parser as parser
from screwgauge.reference.files import LIMITS, digest, named_file, read_file, read_json
from screwgauge.reference.outputs import replace_file


def printed_by(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
