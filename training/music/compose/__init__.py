"""Composes and renders music with exactly known beats: club, band, chip and other styles, from one random stream."""

import numpy as np

from ..piece import SAMPLE_RATE, Piece
from . import instruments, parts
from .arrange import Arranger, clean_events, pickup
from .clock import Clock
from .harmony import Harmony
from .mix import mix
from .styles import STYLES, Style

TRACKER_SPEEDS = (3, 4, 5, 6, 6, 6, 7, 8)


def draw_style(rng: np.random.Generator, name: str | None = None) -> Style:
    """A style by its weight, or the one named."""
    if name is not None:
        return next(s for s in STYLES if s.name == name)
    weights = np.array([s.weight for s in STYLES], float)
    return STYLES[int(rng.choice(len(STYLES), p=weights / weights.sum()))]


def _tempo(rng: np.random.Generator, style: Style) -> tuple[float, float]:
    """Beats a minute and the seconds of a tracker's tick."""
    low, high = style.bpm
    bpm = float(rng.uniform(low, high))
    if style.family == "chip":
        # Four rows a beat, `speed` ticks a row, 2.5 / tempo seconds a tick.
        for _ in range(40):
            speed, tempo = int(rng.choice(TRACKER_SPEEDS)), int(rng.integers(90, 200))
            if low <= tempo * 6 / speed <= high:
                return tempo * 6 / speed, 2.5 / tempo
    if rng.random() < 0.6:
        bpm = float(round(bpm))
    return bpm, float(rng.choice([0.02, 0.0167, 0.01, 0.025]))


def compose(rng: np.random.Generator, seconds: float, style_name: str | None = None, form_name: str | None = None) -> Piece:
    """A piece of `seconds`, of a style drawn by its weight or of the one named, in the form of its style or the one named."""
    style = draw_style(rng, style_name)
    bpm, tick_s = _tempo(rng, style)
    bar = int(parts.choose(rng, style.beats_per_bar))
    if bar == 4 and style.name not in ("house", "trance", "hard") and rng.random() < 0.025:
        bar = 3
    sub = 3 if rng.random() < style.triplets else 4
    live = bool(rng.random() < style.live)
    lead_s = float(rng.uniform(0, 2.5)) if rng.random() < 0.15 else 0.0
    clock = Clock.draw(rng, bpm, seconds + 12, bar, live)
    chance, most, unit = style.swing
    if sub == 4 and rng.random() < chance:
        clock.swing, clock.unit = float(rng.uniform(0.52, most)), unit if rng.random() < 0.8 else 1.5 - unit
    skipped_s = float(clock.at(np.array([pickup(rng, bar)]))[0]) - lead_s
    count = int(seconds * SAMPLE_RATE)
    beats = int(np.searchsorted(clock.times_s, seconds + skipped_s)) + 1

    drums, firm = parts.drum_parts(rng, style, bar, sub)
    band = drums + parts.tuned_parts(rng, style, (bar, sub), tick_s, firm)
    if not band:
        band = parts.tuned_parts(rng, draw_style(rng, "arpeggio"), (bar, sub), tick_s, True)
    band = band or parts.drum_parts(rng, draw_style(rng, "drums"), bar, sub)[0]
    parts.follow_kick(band)
    chip = style.family == "chip"
    sounds = {role: instruments.drum(rng, role, style.samples, chip) for role in ("tom", "crash", "snare")}
    snares = [p.sound for p in band if p.name == "snare"]
    sounds["snare"] = snares[0] if snares and rng.random() < 0.8 else sounds["snare"]
    sounds["riser"] = instruments.riser(rng)
    form = Arranger(rng, band, Harmony.draw(rng, bar), (bar, sub), form_name or style.form).write(beats, sounds)
    for part in band:
        if part.group in ("lead", "chords") and part.manner not in ("pad", "chug", "ring") and rng.random() < 0.25:
            parts.echo(rng, part)
        clean_events(part)
        part.late_s = float(np.clip(rng.normal(0, 0.003), -0.008, 0.008)) if live else 0.0

    shifted = Clock(clock.times_s - skipped_s, clock.swing, clock.unit)
    ducked = style.family == "synth" and rng.random() < 0.4 or rng.random() < 0.04
    live_s = float(rng.uniform(0.001, 0.008)) if live else 0.0
    audio = mix(rng, band, shifted, form, count, ducked, live_s)
    inside = (shifted.times_s >= 0) & (shifted.times_s < seconds)
    positions = (np.arange(len(shifted.times_s)) % bar + 1)[inside]
    sections = [(max(float(shifted.times_s[beat]), 0.0), name) for beat, name in form.sections]
    return Piece(audio, shifted.times_s[inside], positions, bar, style.name, "compose", sections)
