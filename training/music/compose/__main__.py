"""Composes one piece: python3 -m training.music.compose --seed 1 --seconds 45 -o x.wav writes x.wav and x.beats. With
--form set the piece has the sections of dance music, and x.sections is written, too: the time in seconds and the name of each section."""

import argparse
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from ..piece import SAMPLE_RATE
from . import compose

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--seconds", type=float, default=45.0)
parser.add_argument("--style", help="one style instead of a drawn one")
parser.add_argument("--form", help="the form instead of that of the style; set: intro, groove, breakdown, build-up, drop, outro")
parser.add_argument("-o", "--output", type=Path, required=True)
arguments = parser.parse_args()
piece = compose(np.random.default_rng(arguments.seed), arguments.seconds, arguments.style, arguments.form)
wavfile.write(arguments.output, SAMPLE_RATE, np.round(piece.audio * 32767).astype(np.int16))
arguments.output.with_suffix(".beats").write_text("".join(f"{t:.4f}\n" for t in piece.beats))
if piece.sections:
    arguments.output.with_suffix(".sections").write_text("".join(f"{t:.4f} {name}\n" for t, name in piece.sections))
bpm = 60 / np.median(np.diff(piece.beats))
print(f"{piece.style}, {piece.beats_per_bar} beats a bar, {bpm:.1f} bpm, {len(piece.beats)} beats")
