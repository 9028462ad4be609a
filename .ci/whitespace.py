"""Take trailing whitespace from the lines of files, and end each file in one newline."""

import sys
from pathlib import Path


def main(names: list[str]) -> int:
    """Mend the files; return 1 if one was changed."""
    changed = 0
    for file in map(Path, names):
        before = file.read_bytes()
        lines = [line.rstrip() for line in before.splitlines()]
        after = b"\n".join(lines).rstrip(b"\n")
        after += b"\n" if after else b""
        if after != before:
            file.write_bytes(after)
            print(f"{file}: mended")
            changed = 1
    return changed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
