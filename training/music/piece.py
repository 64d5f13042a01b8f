"""A piece of music with exactly known beats; every source of training music returns one."""

from dataclasses import dataclass, field

import numpy as np

SAMPLE_RATE = 44100


@dataclass
class Piece:
    """Music and its notated beats.

    audio: float32 mono at 44100 Hz, peak <= 1.
    beats: float64 seconds, ascending; a drum hit on the beat attacks at the beat's time.
    positions: int, position in the bar of each beat, 1 = downbeat.
    source: the generator, e.g. "compose", "mma", "midi".
    sections: the time in seconds of the first beat of each section, and its name, where they are known.
    """

    audio: np.ndarray
    beats: np.ndarray
    positions: np.ndarray
    beats_per_bar: int
    style: str
    source: str
    sections: list[tuple[float, str]] = field(default_factory=list)
