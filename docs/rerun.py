"""Run the examples of a page again and put their output below them.

    python docs/rerun.py docs/comparison.md docs/shapes.md

Commands are the lines that start with ``$`` in blocks marked ``console``; a block has one
shell. Blocks marked ``python run`` share one session, and what they print goes into the block
marked ``text`` that follows. All run in the root of the repository.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
CONSOLE = re.compile(r"(```console\n)(.*?)(```)", re.DOTALL)
PYTHON = re.compile(r"(```python run\n(.*?)```\n)(?:\n```text\n(.*?)```\n)?", re.DOTALL)


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


def printed(code: str, session: dict[str, Any]) -> str:
    """Run code in a session and give what it prints."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(code, session)  # noqa: S102  the page's own code
    return "".join(f"{line.rstrip()}\n" for line in output.getvalue().splitlines())


def updated(text: str) -> str:
    """Give a page with the output of all its examples."""
    session: dict[str, Any] = {}

    def again(block: re.Match[str]) -> str:
        output = printed(block[2], session)
        return f"{block[1]}\n```text\n{output}```\n" if output else block[1]

    return PYTHON.sub(again, CONSOLE.sub(rerun, text))


if __name__ == "__main__":
    pages = [Path(name).resolve() for name in sys.argv[1:]]
    os.chdir(ROOT)
    for page in pages:
        page.write_text(updated(page.read_text(encoding="utf-8")), encoding="utf-8")
