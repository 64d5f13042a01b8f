"""Evaluates the whole tracker on a folder of music with known beats: `python3 -m training.evaluate FOLDER --program PROGRAM`.

In: FOLDER/NAME.{wav,flac,ogg,mp3}, NAME.beats (seconds, one per line) and, optionally, NAME.downbeats (the same), NAME.ignore (spans that are not
judged) and manifest.json (kind of each piece); PROGRAM, a built `corybant`. Out: a table on standard output, `--json FILE` for the values of each piece.

The first 5 s of each piece are not judged. F-measure and continuity (CMLt, AMLt) as in mir_eval. Each true beat has one class:

| class | the estimates near the beat |
|---|---|
| ok | one within 70 ms, none between this beat and the next |
| before lock | fewer than four until this beat |
| silent | no estimate within one and a half beats |
| off-beat | right tempo, half a period away |
| phase | right tempo, another distance |
| double, half | double or half the tempo |
| 2:3 | two thirds, three quarters, four thirds or one and a half times the tempo |
| other | another tempo |

With `--downbeats`, a second table shows the bars of the pieces that have downbeats, for each number of beats in most of their bars: the F-measure
of the downbeats over everything and over the right beats only, the share of pieces with the right bar length after 16 and after 32 estimated beats,
and how often per piece the length changes to a wrong one.
"""

import argparse
import json
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import mir_eval
import numpy as np

SKIP_S = 5.0
"""Length of the beginning that is not judged."""
TOLERANCE_S = 0.07
SAME_TEMPO = 0.12
"""Greatest deviation of a tempo ratio, as a natural logarithm, from the ratio that names a class."""
RATIOS = {"double": (0.5,), "half": (2.0,), "2:3": (2 / 3, 3 / 4, 4 / 3, 3 / 2)}
OFF_BEAT = (0.33, 0.67)
"""Distances of an off-beat from the beat before it, in beat periods."""
LOCK_BEATS = 4
RIGHT_BEATS = 32
"""Number of right beats in a row (eight bars in four) after which the tracker counts as having been right."""
CONFIDENCE_BINS = np.arange(0.4, 1.01, 0.1)
SOUNDS = (".wav", ".flac", ".ogg", ".mp3")
LENGTH_BEATS = (16, 32)
"""Numbers of estimated beats after which the bar length is judged."""


@dataclass
class Result:
    """The scores of one piece."""

    name: str
    kind: str
    f: float
    cmlt: float
    amlt: float
    classes: dict[str, int]
    off_beat_runs: list[int]
    """Lengths, in beats, of the stretches half a period off after RIGHT_BEATS right beats."""
    confidence: list[tuple[float, bool]]
    """Confidence of each estimate, and whether it is right."""
    bars: "Bars | None"
    """Scores of the bars; none without downbeats."""


@dataclass
class Bars:
    """The scores of the bars of one piece."""

    metre: int
    """Number of beats in most bars."""
    f: float
    f_where_right: float | None
    """F-measure over the right beats only; none if there are too few."""
    length_is_right: list[bool]
    """Whether the bar length is right after each of LENGTH_BEATS."""
    wrong_changes: int


@dataclass
class Estimates:
    """The beats of the tracker, in rising order of time."""

    times: np.ndarray
    confidences: np.ndarray
    positions: np.ndarray
    """Places in the bar, from 1."""
    lengths: np.ndarray
    """Numbers of beats in the bar."""


def column(path: Path) -> np.ndarray:
    """The numbers of a file, as rows; empty if there is no file."""
    if not path.exists() or path.stat().st_size == 0:
        return np.zeros((0, 1))
    return np.loadtxt(path, ndmin=2)


def estimates(program: Path, song: Path, options: list[str]) -> Estimates:
    """The estimated beats: columns 1 and 4 to 6 of the output."""
    output = subprocess.run([program, "beats", song, "--bars", *options], check=True, capture_output=True, text=True).stdout
    rows = np.array([[float(x) for x in line.split()] for line in output.splitlines()]).reshape(-1, 6)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return Estimates(rows[:, 0], rows[:, 3], rows[:, 4], rows[:, 5])


def is_near(times: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Whether each of `times` has one of the sorted `others` within TOLERANCE_S."""
    if len(others) == 0:
        return np.zeros(len(times), bool)
    after = np.searchsorted(others, times)
    nearest = np.minimum(np.abs(times - others[np.minimum(after, len(others) - 1)]), np.abs(times - others[np.maximum(after - 1, 0)]))
    return nearest <= TOLERANCE_S


def wrong_class(beat: float, period: float, found: np.ndarray) -> str:
    """The class of a beat that was not found; `period` is the true beat period there."""
    near = found[np.abs(found - beat) < 1.5 * period]
    if len(near) == 0:
        return "silent"
    wide = found[np.abs(found - beat) < 3.5 * period]
    if len(wide) < 3:
        return "other"
    ratio = float(np.median(np.diff(wide))) / period
    is_ratio = lambda value: abs(np.log(ratio / value)) < SAME_TEMPO  # noqa: E731
    if is_ratio(1.0):
        distance = ((near[np.argmin(np.abs(near - beat))] - beat) / period) % 1.0
        return "off-beat" if OFF_BEAT[0] < distance < OFF_BEAT[1] else "phase"
    return next((name for name, values in RATIOS.items() if any(map(is_ratio, values))), "other")


def classes(truth: np.ndarray, found: np.ndarray) -> list[str]:
    """The class of each true beat but the last."""
    hit, out = is_near(truth, found), []
    locked_s = found[LOCK_BEATS - 1] if len(found) >= LOCK_BEATS else np.inf
    for i, beat in enumerate(truth[:-1]):
        period = truth[i + 1] - beat
        between = np.any((found > beat + 0.25 * period) & (found < beat + 0.75 * period))
        if hit[i]:
            out.append("double" if between else "ok")
        else:
            out.append(wrong_class(beat, period, found) if beat >= locked_s else "before lock")
    return out


def off_beat_runs(of_beats: list[str]) -> list[int]:
    """Lengths of the stretches of off-beats that follow RIGHT_BEATS right beats."""
    runs, right, length, was_right = [], 0, 0, False
    for name in [*of_beats, "end"]:
        if name == "off-beat":
            length += 1
            was_right = was_right or right >= RIGHT_BEATS
            right = 0
            continue
        if length and was_right:
            runs.append(length)
        length, was_right = 0, False
        right = right + 1 if name == "ok" else 0
    return runs


def nearest(times: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The index of the nearest of the sorted `others` (at least two), for each of `times`."""
    after = np.clip(np.searchsorted(others, times), 1, len(others) - 1)
    return np.where(times - others[after - 1] <= others[after] - times, after - 1, after)


def score_bars(truth: np.ndarray, downbeats: np.ndarray, found: Estimates, kept: np.ndarray, judged) -> Bars:  # noqa: ANN001
    """The scores of the bars. `kept` marks the estimates that are judged; `judged` does so for times."""
    starts = np.unique(nearest(downbeats, truth))
    metre = Counter(np.diff(starts).tolist()).most_common(1)[0][0]
    is_first = found.positions == 1
    true, estimated = downbeats[judged(downbeats)], np.unique(found.times[kept & is_first])
    f = mir_eval.beat.f_measure(true, estimated, TOLERANCE_S) if len(true) and len(estimated) else 0.0
    beats = nearest(found.times, truth)
    after = np.minimum(beats + 1, len(truth) - 1)
    period = truth[after] - truth[beats]
    doubled = [np.any((found.times > t + 0.25 * p) & (found.times < t + 0.75 * p)) for t, p in zip(truth[beats], period)]
    right = kept & (np.abs(found.times - truth[beats]) <= TOLERANCE_S) & ~np.array(doubled, bool)
    is_true, is_estimated = np.isin(beats[right], starts), is_first[right]
    count = is_true.sum() + is_estimated.sum()
    where_right = float(2 * (is_true & is_estimated).sum() / count) if is_true.sum() > 1 else None
    lengths = found.lengths
    changes = int(np.sum((lengths[1:] != lengths[:-1]) & (lengths[1:] != metre)))
    at = lambda beat: bool(len(lengths) and lengths[min(beat, len(lengths) - 1)] == metre)  # noqa: E731
    return Bars(int(metre), float(f), where_right, [at(beat) for beat in LENGTH_BEATS], changes)


def evaluate(program: Path, song: Path, kind: str, options: list[str]) -> Result:
    """Runs the tracker on one piece and scores its beats."""
    truth = column(song.with_suffix(".beats"))[:, 0]
    ignored = column(song.with_suffix(".ignore"))
    all_found = estimates(program, song, options)
    found, confidence = all_found.times, all_found.confidences
    judged = lambda times: (times >= SKIP_S) & ~np.any([(times >= s) & (times < e) for s, e in ignored] or [np.zeros(len(times), bool)], axis=0)  # noqa: E731
    in_music = found <= truth[-1] + 0.5 * np.median(np.diff(truth))
    of_beats = [name for name, keep in zip(classes(truth, found), judged(truth)) if keep]
    kept = judged(found) & in_music
    right = is_near(found[kept], truth)
    true, estimated = truth[judged(truth)], np.unique(found[kept])
    continuity = mir_eval.beat.continuity(true, estimated) if len(estimated) > 1 else (0.0,) * 4
    f = mir_eval.beat.f_measure(true, estimated, TOLERANCE_S) if len(estimated) else 0.0
    pairs = [(float(c), bool(ok)) for c, ok in zip(confidence[kept], right)]
    downbeats = column(song.with_suffix(".downbeats"))[:, 0]
    bars = score_bars(truth, downbeats, all_found, kept, judged) if len(downbeats) > 1 else None
    return Result(song.stem, kind, f, continuity[1], continuity[3], dict(Counter(of_beats)), off_beat_runs(of_beats), pairs, bars)


def table(results: list[Result]) -> str:
    """Means over all pieces and over the pieces of each kind, error classes in percent of all beats, and calibration."""
    lines = [f"{'kind':32} {'n':>4} {'F':>6} {'CMLt':>6} {'AMLt':>6}  classes in % of the beats"]
    kinds = sorted({one.kind for one in results})
    for name in ["all", *(kinds if len(kinds) > 1 else [])]:
        some = [one for one in results if name in ("all", one.kind)]
        count = sum((Counter(one.classes) for one in some), Counter())
        shares = ", ".join(f"{key} {100 * value / count.total():.1f}" for key, value in count.most_common())
        means = [float(np.mean([getattr(one, key) for one in some])) for key in ("f", "cmlt", "amlt")]
        lines.append(f"{name[:32]:32} {len(some):4} " + " ".join(f"{mean:6.3f}" for mean in means) + f"  {shares}")
    runs = sorted(length for one in results for length in one.off_beat_runs)
    if runs:
        lines.append(f"half a period off after having been right: {len(runs)} times; beats: 95 % at most {np.quantile(runs, 0.95):.0f}, longest {runs[-1]}")
    pairs = np.array([pair for one in results for pair in one.confidence]).reshape(-1, 2)
    lines.append("confidence: share of right beats (number of beats)")
    for low, high in zip(CONFIDENCE_BINS, CONFIDENCE_BINS[1:]):
        inside = pairs[(pairs[:, 0] >= low) & (pairs[:, 0] < high)]
        if len(inside):
            lines.append(f"  {inside[:, 0].mean():.2f}: {inside[:, 1].mean():.2f} ({len(inside)})")
    return "\n".join(lines)


def bars_table(results: list[Result]) -> str:
    """Means of the scores of the bars, for each number of beats in most bars."""
    lines = [f"{'beats in a bar':>14} {'n':>4} {'F':>6} {'right':>6} " + " ".join(f"{f'at {beat}':>6}" for beat in LENGTH_BEATS) + f" {'wrong changes':>14}"]
    scored = [one.bars for one in results if one.bars]
    for metre in sorted({one.metre for one in scored}):
        some = [one for one in scored if one.metre == metre]
        where_right = [one.f_where_right for one in some if one.f_where_right is not None]
        means = [np.mean([one.f for one in some]), np.mean(where_right or [np.nan]), *np.mean([one.length_is_right for one in some], axis=0)]
        changes = np.mean([one.wrong_changes for one in some])
        lines.append(f"{metre:14} {len(some):4} " + " ".join(f"{mean:6.3f}" for mean in means) + f" {changes:14.3f}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--program", type=Path, default=Path("target/release/corybant"))
    parser.add_argument("--whole", action="store_true", help="analyse whole files instead of predicting beats as in a live show")
    parser.add_argument("--tracker", default="net")
    parser.add_argument("--downbeats", action="store_true", help="also show the scores of the bars")
    parser.add_argument("--beats-per-bar", default="auto", help="auto, 2, 3 or 4")
    parser.add_argument("--json", type=Path, help="file for the scores of each piece")
    options = parser.parse_args()
    arguments = ["--beats-per-bar", options.beats_per_bar, *(["--whole"] if options.whole else ["--tracker", options.tracker])]
    songs = sorted(path for path in options.folder.iterdir() if path.suffix in SOUNDS and path.with_suffix(".beats").exists())
    if not songs:
        parser.error(f"{options.folder} holds no music with beats (NAME.wav and NAME.beats)")
    manifest = options.folder / "manifest.json"
    entries = json.loads(manifest.read_text()) if manifest.exists() else []
    kinds = {Path(entry["file"]).stem: entry.get("kind", "") for entry in entries}
    with ThreadPoolExecutor() as pool:
        run = lambda song: evaluate(options.program, song, kinds.get(song.stem, ""), arguments)  # noqa: E731
        results = list(pool.map(run, songs))
    print(table(results))
    if options.downbeats:
        print(bars_table(results))
    if options.json:
        options.json.write_text(json.dumps([asdict(one) for one in results], indent=1))


if __name__ == "__main__":
    main()
