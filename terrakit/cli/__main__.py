"""``python -m terrakit.cli``."""

from __future__ import annotations

from terrakit.cli import main

if __name__ == "__main__":
    main()
