"""The command line, and the files that it reads and writes."""

import subprocess
import sys

from screwgauge.cli import GROUPS, main
from screwgauge.cli import _parser as parser
from screwgauge.reference.files import LIMITS, digest, named_file, read_file, read_json
from screwgauge.reference.outputs import replace_file

#: What the console script does.
CLI = "import sys; from screwgauge.cli import main; sys.exit(main(sys.argv[1:]))"


def printed_by(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def loaded_after(code: str, *names: str) -> set[str]:
    """Those of some modules that a fresh Python has loaded after some code."""
    return {*printed_by(f"{code}\nimport sys\nprint(*[name for name in {names} if name in sys.modules])").split()}
