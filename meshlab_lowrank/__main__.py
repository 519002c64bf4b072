"""``python -m meshlab_lowrank``: the command ``meshlab-lowrank``."""

from __future__ import annotations

import sys

from meshlab_lowrank.cli import main

if __name__ == "__main__":
    sys.exit(main())
