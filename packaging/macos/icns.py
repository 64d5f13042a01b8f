"""Writes an icon file of macOS: python3 icns.py FOLDER ICON.icns. FOLDER has 128.png, 256.png, 512.png and 1024.png."""

import pathlib
import struct
import sys

# The type of an entry says the size of its PNG picture.
TYPES = {128: b"ic07", 256: b"ic08", 512: b"ic09", 1024: b"ic10"}

folder, icon = map(pathlib.Path, sys.argv[1:])
entries = b""
for size, kind in TYPES.items():
    picture = (folder / f"{size}.png").read_bytes()
    entries += kind + struct.pack(">I", len(picture) + 8) + picture
icon.write_bytes(b"icns" + struct.pack(">I", len(entries) + 8) + entries)
