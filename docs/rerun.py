"""Run the commands of a page again and put their output below them.

    python docs/rerun.py docs/comparison.md

Commands are the lines that start with ``$`` in blocks marked ``console``; a block has one
shell, in the root of the repository.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
BLOCK = re.compile(r"(```console\n)(.*?)(```)", re.DOTALL)


def rerun(block: re.Match[str]) -> str:
    """Give a block with its commands and their new output."""
    commands = [line for line in block[2].splitlines() if line.startswith("$ ")]
    script = "\n".join(line.removeprefix("$ ") for line in commands)
    done = subprocess.run(  # noqa: S603  the page's own commands
        ["bash", "-c", script],  # noqa: S607
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    output = "\n".join(line.rstrip() for line in done.stdout.splitlines())
    return f"{block[1]}{chr(10).join(commands)}\n{output}\n{block[3]}"


if __name__ == "__main__":
    for name in sys.argv[1:]:
        page = Path(name)
        page.write_text(BLOCK.sub(rerun, page.read_text(encoding="utf-8")), encoding="utf-8")
