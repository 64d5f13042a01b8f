"""Scores the sections that a built `corybant` finds live in music with known sections:
python3 -m training.evaluate_form FOLDER [--corybant target/release/corybant]

FOLDER has NAME.wav or NAME.ogg, NAME.beats and NAME.sections (`python3 -m training.music.compose --form set`). Starts of sections count as right within half a
bar. The first eight beats are not judged."""

import argparse
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from scipy.io import wavfile

BAR = 4
NEAR, FIRST = BAR / 2, 8


def found_by(program: Path, sound: Path, beats: np.ndarray) -> list[tuple[float, float, str, str]]:
    """The sections of `sound`: first beat, beat of the decision, name, and announced or begun."""
    lines = subprocess.run([program, "beats", "--sections", sound], capture_output=True, check=True, text=True).stdout.splitlines()
    place = lambda time: float(np.interp(float(time), beats, np.arange(len(beats))))
    rows = [line.split("\t") for line in lines]
    return [(place(row[0]), place(row[1]), row[2], row[4]) for row in rows]


def hits(found: list[float], right: list[float]) -> int:
    """The number of starts of sections `right` that have a start of `found` of their own nearby."""
    free, count = list(found), 0
    for start in right:
        near = next((other for other in free if abs(other - start) <= NEAR), None)
        if near is not None:
            free.remove(near)
            count += 1
    return count


def novelties(sound: Path, beats: np.ndarray) -> np.ndarray:
    """[beat]: change of the level in dB from the eight beats before to the last two."""
    rate, samples = wavfile.read(sound)
    samples = samples.astype(np.float64).reshape(len(samples), -1).mean(1)
    edges = (beats * rate).astype(int)
    level_db = np.array([10 * np.log10(np.mean(samples[a : max(b, a + 1)] ** 2) + 1e-3) for a, b in zip(edges[:-1], edges[1:])])
    return np.array([0.0 if t < 10 else abs(level_db[t - 1 : t + 1].mean() - level_db[t - 9 : t - 1].mean()) for t in range(len(level_db))])


def peaks(novelty: np.ndarray, least_db: float) -> list[float]:
    """The beats at which the novelty exceeds `least_db`, at least eight beats from each other."""
    starts: list[float] = []
    for beat in np.flatnonzero(novelty > least_db):
        if beat > FIRST and (not starts or beat - starts[-1] > 8):
            starts.append(float(beat))
    return starts


def f_measure(counts: np.ndarray) -> str:
    """F, precision and recall of (hits, found, right)."""
    hit, found, right = counts
    return f"F {2 * hit / max(found + right, 1):.3f} (precision {hit / max(found, 1):.3f}, recall {hit / max(right, 1):.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--corybant", type=Path, default=Path("target/release/corybant"))
    arguments = parser.parse_args()
    sounds = sorted(path for path in arguments.folder.iterdir() if path.suffix in (".wav", ".ogg") and path.with_suffix(".sections").exists())
    beats = [np.loadtxt(sound.with_suffix(".beats")) for sound in sounds]
    with ThreadPoolExecutor(2) as pool:
        all_found = list(pool.map(lambda pair: found_by(arguments.corybant, *pair), zip(sounds, beats)))
    limits = (3, 4, 5, 6, 8)
    found_counts, bar_counts, peak_counts = np.zeros(3), np.zeros(3), np.zeros((len(limits), 3))
    early = announced = announced_right = drops = drops_hit = drops_false = 0
    minutes = 0.0
    for sound, times, found in zip(sounds, beats, all_found):
        rows = [line.split() for line in sound.with_suffix(".sections").read_text().splitlines()]
        sections = [(float(np.interp(float(time), times, np.arange(len(times)))), name) for time, name in rows]
        right = [beat for beat, _ in sections if beat > FIRST]
        begun = [(beat, decided, name) for beat, decided, name, word in found if word == "begun" and beat > FIRST]
        # A section can get another name after its start.
        starts = sorted({round(beat) for beat, _, _ in begun})
        found_counts += hits(starts, right), len(starts), len(right)
        counted = [float(beat) for beat in range(8 * BAR, len(times), 8 * BAR)]
        bar_counts += hits(counted, right), len(counted), len(right)
        novelty = novelties(sound, times) if sound.suffix == ".wav" else np.zeros(len(times))
        for counts, least_db in zip(peak_counts, limits):
            starts = peaks(novelty, least_db)
            counts += hits(starts, right), len(starts), len(right)
        # What stands as announced four beats before a start.
        ahead = [(beat, decided) for beat, decided, _, word in found if word == "announced"]
        early += sum(any(abs(beat - start) <= NEAR and decided <= start - 3.9 for beat, decided in ahead) for start in right)
        places = sorted({round(beat / BAR) * BAR for beat, decided in ahead if beat - decided >= 3.9})
        announced += len(places)
        announced_right += sum(any(abs(place - start) <= NEAR for start in right) for place in places)
        real = [beat for beat, name in sections if name == "drop" and beat > FIRST]
        told = [decided for _, decided, name in begun if name == "drop"]
        drops += len(real)
        drops_hit += sum(any(abs(decided - drop) <= 1.1 for decided in told) for drop in real)
        drops_false += sum(not any(abs(decided - drop) <= BAR for drop in real) for decided in told)
        minutes += (times[-1] - times[0]) / 60
    print(f"{len(sounds)} pieces, {minutes:.0f} minutes, {int(found_counts[2])} starts of sections")
    print(f"starts within half a bar: {f_measure(found_counts)}")
    print(f"  a section every 8 bars: {f_measure(bar_counts)}")
    print(f"  novelty of the energy, best limit: {f_measure(max(peak_counts, key=lambda c: c[0] / max(c[1] + c[2], 1)))}")
    print(f"announced at least 4 beats ahead: {early / max(found_counts[2], 1):.3f}; right: {announced_right / max(announced, 1):.3f} of {announced}")
    print(f"drops told within one beat: {drops_hit / max(drops, 1):.3f} of {drops}; false drops: {drops_false / max(minutes, 1e-9):.3f} a minute")


main()
