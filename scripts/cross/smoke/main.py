"""The checks of the script `wine`, inside its Debian system. The working folder has corybant.exe and perhaps corybant (for
Linux), song.* and motions/. Each program writes into a folder of its own, windows/ and linux/.

Prints one line per check, PASS or FAIL, with figures, and then a table of figures of both programs. The exit code is 1 if a
check fails.
"""

import glob
import os
import sys

import changes
import figures
import files
import film
import motions
import pages
import shows
import sound
from programs import Receiver
from report import HAS_SOUND, LINUX, WINDOWS, failures, report


def check(poses: Receiver, song: str | None) -> None:
    """All checks but those of the figures."""
    files.check_files(song)
    files.check_doctor()
    film.check_film()
    shows.check_demo(poses)
    pages.check_start(poses)
    pages.check_import()
    changes.check_graph_swap(poses)
    changes.check_performer(poses)
    if song:
        shows.check_ends(poses, song)
        shows.check_recordings(poses, song)
        shows.check_bars(poses, song)
    if song and HAS_SOUND:
        sound.check_devices(poses, song)
        sound.check_diagnosis(poses, song)


def main() -> None:
    song = (glob.glob("song.*") or [None])[0]
    poses = Receiver()
    code, out, _, took = WINDOWS.run("--help")
    report("help", code == 0 and "Usage" in out, f"{took:.1f} s")
    motions.make("formats")
    programs = [program for program in (WINDOWS, LINUX) if program]
    seconds = {program.name: files.make(program, song) for program in programs}
    if os.environ.get("FIGURES") != "only":
        check(poses, song)
    columns = {program.name: figures.of(program, poses, seconds[program.name]) for program in programs}
    print("\n" + figures.table(columns), flush=True)


main()
print(f"{len(failures)} checks fail: {failures}" if failures else "All checks pass.")
sys.exit(len(failures) > 0)
