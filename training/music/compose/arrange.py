"""The form of a piece: sections, instruments of each section, fills, rolls, stops. Writes the events of all parts."""

from dataclasses import dataclass

import numpy as np

from . import instruments, rhythm
from .harmony import Harmony
from .parts import Part, write_bar

# Chance of each group to play in a section.
PLAYS = {
    "intro": {"kick": 0.6, "snare": 0.3, "hats": 0.5, "percussion": 0.5, "bass": 0.35, "chords": 0.5, "lead": 0.15},
    "main": {"kick": 0.97, "snare": 0.93, "hats": 0.92, "percussion": 0.8, "bass": 0.95, "chords": 0.85, "lead": 0.6},
    "verse": {"kick": 0.95, "snare": 0.9, "hats": 0.85, "percussion": 0.4, "bass": 0.9, "chords": 0.7, "lead": 0.6},
    "break": {"kick": 0.06, "snare": 0.12, "hats": 0.25, "percussion": 0.25, "bass": 0.35, "chords": 0.97, "lead": 0.6},
    "build": {"kick": 0.5, "snare": 0.0, "hats": 0.5, "percussion": 0.4, "bass": 0.25, "chords": 0.9, "lead": 0.4},
    "beat": {"kick": 0.95, "snare": 0.9, "hats": 0.8, "percussion": 0.9, "bass": 0.3, "chords": 0.08, "lead": 0.03},
    "drop": {"kick": 1.0, "snare": 0.97, "hats": 0.97, "percussion": 0.9, "bass": 1.0, "chords": 0.95, "lead": 0.8},
    "loose": {"kick": 0.75, "snare": 0.75, "hats": 0.7, "percussion": 0.6, "bass": 0.75, "chords": 0.7, "lead": 0.5},
}
FORMS = {
    "club": ("intro", "main", "main", "break", "build", "main", "main", "beat", "break", "build", "main", "loose"),
    "song": ("intro", "verse", "main", "verse", "main", "loose", "main", "break", "main"),
    "metronome": ("metronome",),
    "loop": ("intro", "main", "loose", "main", "loose", "beat", "main", "break", "main"),
}

# The form of dance music with its drops: the name of each section, how it is written (a key of PLAYS), and its possible lengths in bars.
SET = (
    ("intro", "intro", (8, 16)),
    ("groove", "main", (8, 16, 16, 32)),
    ("breakdown", "break", (4, 8, 8, 16)),
    ("build-up", "build", (4, 8, 8, 16)),
    ("drop", "drop", (16, 16, 32)),
    ("groove", "main", (8, 8, 16)),
    ("breakdown", "break", (4, 8, 16)),
    ("build-up", "build", (4, 8, 8)),
    ("drop", "drop", (16, 16, 32)),
    ("outro", "intro", (8, 16)),
)


@dataclass
class Form:
    """Data besides events. silences: for the mixer, as (first beat, last beat). sections: the first beat and the name of each section of a
    piece with the form "set"; empty for other forms."""

    silences: list[tuple[float, float]]
    sections: list[tuple[int, str]]


class Arranger:
    """Writes a piece section by section until its beats are used up."""

    def __init__(self, rng: np.random.Generator, parts: list[Part], harmony: Harmony, meter: tuple[int, int], form: str):
        """meter: (beats in a bar, steps in a beat)."""
        self.rng, self.parts, self.harmony = rng, parts, harmony
        self.bar, self.sub = meter
        self.sections = FORMS.get(form, ())
        # The build-ups of dance music mostly have a riser.
        self.riser_chance = 0.5 if self.sections else 0.8
        self.fill_every = int(rng.choice([2, 4, 4, 8, 8, 1000]))
        self.fill_chance = rng.uniform(0.3, 1.0)
        self.silences: list[tuple[float, float]] = []
        self.extras: dict[str, Part] = {}

    def extra(self, name: str, group: str, sound: instruments.Sound) -> Part:
        """A part that plays by the form: rolls, fills, crashes, risers."""
        if name not in self.extras:
            self.extras[name] = Part(name, group, sound, [])
        return self.extras[name]

    def write(self, beats: int, sounds: dict[str, instruments.Sound]) -> Form:
        """Fills `beats` beats; sounds: "tom", "snare", "crash", "riser"."""
        if not self.sections:
            return self._write_set(beats, sounds)
        at = int(self.rng.integers(len(self.sections)))
        start = 0
        while start < beats:
            kind = self.sections[at % len(self.sections)]
            bars = int(self.rng.choice([2, 4, 8, 3, 1, 6], p=[0.2, 0.4, 0.28, 0.04, 0.04, 0.04]))
            self._section(kind, start, bars, sounds)
            start += bars * self.bar
            at += 1 if self.rng.random() < 0.85 else int(self.rng.integers(1, 4))
        self.parts.extend(self.extras.values())
        return Form(self.silences, [])

    def _write_set(self, beats: int, sounds: dict[str, instruments.Sound]) -> Form:
        """Writes the sections of SET, and begins again if beats are left."""
        start, sections = 0, []
        while start < beats:
            for name, kind, lengths in SET:
                # A groove after a drop, and a build-up, may be missing.
                if start >= beats or (name in ("groove", "build-up") and start and self.rng.random() < 0.15):
                    continue
                bars = int(self.rng.choice(lengths))
                sections.append((start, name))
                self._section(kind, start, bars, sounds)
                start += bars * self.bar
        self.parts.extend(self.extras.values())
        return Form(self.silences, sections)

    def _tick(self, start: int, bars: int) -> None:
        """Bars of the parts as they are, with nothing added but a pause now and then."""
        for k in range(bars):
            for part in self.parts:
                write_bar(part, self.harmony, start + k * self.bar, self.bar, (0, k, 1.0), self.rng)
        if self.rng.random() < 0.06:
            self.silences.append((float(start), float(start + self.bar)))

    def _section(self, kind: str, start: int, bars: int, sounds: dict[str, instruments.Sound]) -> None:
        rng = self.rng
        if kind == "metronome":
            self._tick(start, bars)
            return
        playing = [p for p in self.parts if rng.random() < PLAYS[kind][p.group]]
        if not playing:
            playing = [self.parts[int(rng.integers(len(self.parts)))]]
        variant = {"verse": 0, "main": 1}.get(kind, int(rng.integers(2)))
        pace = float(rng.choice([1, 0.5, 2], p=[0.9, 0.07, 0.03])) if kind != "intro" else 1.0
        for k in range(bars):
            for part in playing:
                write_bar(part, self.harmony, start + k * self.bar, self.bar, (variant, k, pace), rng)
        end = float(start + bars * self.bar)
        drums_play = any(p.group in ("kick", "snare") for p in playing)
        if kind == "build":
            self._roll(start, end, sounds)
        elif drums_play:
            for k in range(bars):
                last = k == bars - 1
                if (last or (k + 1) % self.fill_every == 0) and rng.random() < self.fill_chance:
                    self._fill(float(start + (k + 1) * self.bar), sounds)
                    if rng.random() < 0.35:
                        self.extra("crash", "hats", sounds["crash"]).events.append((float(start + (k + 1) * self.bar), 1.0, (0,), 1.0))
        if rng.random() < 0.65 and kind in ("main", "verse", "break", "beat"):
            self.extra("crash", "hats", sounds["crash"]).events.append((float(start), 1.0, (0,), 1.0))
        if rng.random() < (self.riser_chance if kind == "build" else 0.08):
            length = float(min(bars, int(rng.choice([1, 2, 4]))) * self.bar)
            self.extra("riser", "effects", sounds["riser"]).events.append((end - length, length, (int(rng.integers(40, 70)),), 1.0))
        if rng.random() < (0.3 if kind in ("build", "break") else 0.09):
            length = float(rng.choice([0.5, 1, 2, self.bar], p=[0.3, 0.35, 0.2, 0.15]))
            self.silences.append((end - length, end))

    def _roll(self, start: float, end: float, sounds: dict[str, instruments.Sound]) -> None:
        """A snare roll that doubles its speed on the way to the drop."""
        rng = self.rng
        if rng.random() < 0.2:
            return
        steps = [1.0, 0.5, 0.25, 0.125] if rng.random() < 0.5 else [0.5, 0.25, 0.125]
        if rng.random() < 0.3:
            steps = [0.25]
        roll = self.extra("roll", "snare", sounds["snare"])
        edges = np.linspace(start, end, len(steps) + 1)
        for step, begin, stop in zip(steps, edges[:-1], edges[1:]):
            begin, stop = np.round(begin), np.round(stop)
            for beat in np.arange(begin, stop - 1e-6, step):
                roll.events.append((float(beat), step, (0,), 0.3 + 0.7 * (beat - start) / (end - start)))

    def _fill(self, end: float, sounds: dict[str, instruments.Sound]) -> None:
        """Replaces or removes the last half beat to four beats before `end`."""
        rng = self.rng
        begin = end - float(rng.choice([0.5, 1, 2, 3, 4], p=[0.2, 0.35, 0.25, 0.1, 0.1]))
        keep = {p.name for p in self.parts if rng.random() < 0.3}
        for part in self.parts:
            if part.group in ("kick", "snare", "hats", "percussion") and part.name not in keep:
                part.events = [e for e in part.events if not begin <= e[0] < end - 1e-9]
        if rng.random() < 0.2:
            return
        step = float(rng.choice([0.5, 0.25, 0.125, 1 / 3, 1 / 6], p=[0.2, 0.55, 0.05, 0.12, 0.08])) if self.sub == 4 else 1 / 3
        density = rng.uniform(0.4, 1.0)
        hands = [self.extra("tom", "percussion", sounds["tom"]), self.extra("fill", "snare", sounds["snare"])]
        favour = rng.random()
        for beat in np.arange(begin, end - 1e-6, step):
            if rng.random() < density:
                hands[int(rng.random() < favour)].events.append((float(beat), step, (int(rng.integers(3)),), float(rng.uniform(0.5, 1.0))))


def pickup(rng: np.random.Generator, bar: int) -> float:
    """The beat at which the piece starts: the first downbeat, or within a bar."""
    if rng.random() < 0.6:
        return 0.0
    return float(rng.integers(1, bar)) if rng.random() < 0.4 else float(rng.uniform(0, bar))


def clean_events(part: Part) -> None:
    """Keeps one event per place for a drum, in time order."""
    if part.manner == "drum":
        places = rhythm.clean([(e[0], k) for k, e in enumerate(part.events)])
        part.events = [part.events[int(k)] for _, k in places]
    part.events.sort(key=lambda e: e[0])
