"""Trains the form network, which finds the sections of dance music:
python3 -m training.form FOLDER -o crates/corybant-core/src/beat/form/weights.safetensors

Composes PIECES pieces with exact sections (`compose.compose` with the form "set") into FOLDER, unless they are there, and trains on them. The
measurements of a beat are those of `crates/corybant-core/src/beat/form/sound.rs`, the inputs those of `history.rs`, and the network that of
`network.rs`. A tenth of the pieces is held out."""

import argparse
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save_file
from scipy.signal import butter, sosfilt

from training.music.compose import compose
from training.music.piece import SAMPLE_RATE

SECTIONS = ["intro", "groove", "build-up", "drop", "breakdown", "outro"]
BEATS_AHEAD, BEATS_BACK = 16, 4
HIDDEN, STATE = 48, 64
CHUNK = SAMPLE_RATE // 100
BANDS = 3
VALUES = 2 * BANDS + 1
LAGS = (8, 16, 32, 64)
SEQUENCE, BATCH, RATE = 384, 16, 3e-3


def filters() -> list[np.ndarray]:
    """Second-order sections of the low, the middle and the high band."""
    low, high = 150, 3000
    middle = [butter(2, low, "high", fs=SAMPLE_RATE, output="sos"), butter(2, high, fs=SAMPLE_RATE, output="sos")]
    return [butter(2, low, fs=SAMPLE_RATE, output="sos"), np.concatenate(middle), butter(2, high, "high", fs=SAMPLE_RATE, output="sos")]


def onset_strengths(power: np.ndarray) -> np.ndarray:
    """[band, chunk]: onset strength, 0 to 1, of the mean squares `power` of each chunk of 10 ms."""
    smooth = np.array([np.convolve(row, np.ones(3) / 3)[: len(row)] for row in power])
    level_db = np.maximum(10 * np.log10(smooth + 1e-12), -100)
    onsets = np.zeros_like(level_db)
    for band, row in enumerate(level_db):
        envelope = -100.0
        for chunk, value in enumerate(row):
            rise = value - (envelope - 1.2)
            envelope = max(value, envelope - 1.2)
            onsets[band, chunk] = min(rise / 10, 1) if rise > 2.5 else 0
    return onsets


def beat_sounds(audio: np.ndarray, beats: np.ndarray) -> np.ndarray:
    """[beat, value]: level of each band, in dBFS, onsets of each band, kick drum, of each beat but the last."""
    count = len(audio) // CHUNK
    bands = [sosfilt(sos, audio[: count * CHUNK]).reshape(count, CHUNK) for sos in filters()]
    power = np.array([(band * band).mean(1) for band in bands])
    onsets = onset_strengths(power)
    rows = []
    for start, end in zip(beats[:-1], beats[1:]):
        first, last = int(start * 100), max(int(end * 100), int(start * 100) + 1)
        kick = onsets[0, max(first - 4, 0) : first + 7].max(initial=0)
        rows.append(np.concatenate([10 * np.log10(power[:, first:last].mean(1) + 1e-10), onsets[:, first:last].sum(1), [kick]]))
    return np.array(rows)


def inputs(sounds: np.ndarray, positions: np.ndarray, bar: int) -> np.ndarray:
    """[beat, input]: the inputs of the network after each beat; see `history.rs`."""
    levels = sounds[:, :BANDS]
    reference = np.array([np.quantile(levels[max(0, t - 255) : t + 1], 0.85, axis=0) for t in range(len(levels))])
    values = np.concatenate([np.clip((levels - reference) / 10, -4, 0.6), sounds[:, BANDS : 2 * BANDS] / 4, sounds[:, 2 * BANDS :]], 1)
    sums = np.cumsum(np.concatenate([np.zeros((1, VALUES)), values]), 0)

    def mean(newest: int, oldest: int) -> np.ndarray:
        ends = np.maximum(np.arange(len(values)) + 1 - newest, 1)
        starts = np.minimum(np.maximum(np.arange(len(values)) + 1 - oldest, 0), ends - 1)
        return (sums[ends] - sums[starts]) / (ends - starts)[:, None]

    novelty = np.sqrt(((mean(0, 4) - mean(4, 12)) ** 2).sum(1, keepdims=True))
    aged = [np.concatenate([np.zeros((lag, 1)), novelty])[: len(novelty)] for lag in LAGS]
    following = np.append(positions[1:], positions[-1] % bar + 1)[: len(values)]
    places = np.stack([following == 1, (following == 3) & (bar == 4)], 1)
    return np.concatenate([values, mean(0, 4), values - mean(1, 9), novelty, *aged, places], 1).astype(np.float32)


def targets(sections: np.ndarray, starts: np.ndarray) -> list[np.ndarray]:
    """The right outputs after each beat: the section of the beat, the beats until the next section, that section (-1 if it is far), the beats
    since the start of the section."""
    until = np.full(len(sections), BEATS_AHEAD)
    following = np.full(len(sections), -1)
    since = np.full(len(sections), BEATS_BACK)
    for start in starts[starts > 0]:
        ahead = np.arange(max(0, start - BEATS_AHEAD), start)
        until[ahead] = np.minimum(until[ahead], start - 1 - ahead)
        following[ahead] = np.where(until[ahead] == start - 1 - ahead, sections[start], following[ahead])
        back = np.arange(start, min(start + BEATS_BACK, len(sections)))
        since[back] = back - start
    return [sections, until, following, since]


def make_piece(path: Path, seed: int) -> None:
    """Composes the piece of `seed` and writes the sounds of its beats and its sections to `path`."""
    rng = np.random.default_rng(seed)
    piece = compose(rng, float(rng.uniform(150, 300)), None, "set")
    audio = piece.audio if piece.audio.ndim == 1 else piece.audio.mean(1)
    sounds = beat_sounds(audio.astype(np.float32) * 10 ** (rng.uniform(-20, 0) / 20), piece.beats)
    sections, starts = np.zeros(len(sounds), int), []
    for time, name in piece.sections:
        start = int(np.argmin(np.abs(piece.beats - time)))
        if start < len(sounds) and (start == 0 or abs(piece.beats[start] - time) <= 0.1):
            starts.append(start)
            sections[start:] = SECTIONS.index(name)
    np.savez(path, sounds=sounds, sections=sections, starts=starts, positions=piece.positions[: len(sounds)], bar=piece.beats_per_bar)


def read(path: Path, begin: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """The inputs and targets of the piece in `path` from the beat `begin` on, as if the sound began there."""
    data = np.load(path)
    starts = np.append(0, data["starts"] - begin)
    return (
        inputs(data["sounds"][begin:], data["positions"][begin:], int(data["bar"])),
        targets(data["sections"][begin:], starts[starts >= 0]),
    )


class Network(torch.nn.Module):
    """The network of `network.rs`."""

    def __init__(self, width: int):
        super().__init__()
        self.first = torch.nn.Linear(width, HIDDEN)
        self.gates = torch.nn.GRU(HIDDEN, STATE, batch_first=True)
        self.last = torch.nn.Linear(STATE, 2 * len(SECTIONS) + BEATS_AHEAD + 1 + BEATS_BACK + 1)

    def forward(self, rows: torch.Tensor) -> tuple[torch.Tensor, ...]:
        states, _ = self.gates(torch.tanh(self.first(rows)))
        scores = self.last(torch.nn.functional.dropout(states, 0.1, self.training))
        return scores.split([len(SECTIONS), BEATS_AHEAD + 1, len(SECTIONS), BEATS_BACK + 1], -1)


def loss_of(network: Network, rows: torch.Tensor, wanted: list[torch.Tensor]) -> torch.Tensor:
    """The weighted cross entropy of the four outputs."""
    loss = 0.0
    for weight, scores, right in zip((1.0, 1.5, 0.5, 1.5), network(rows), wanted):
        loss = loss + weight * torch.nn.functional.cross_entropy(scores.flatten(0, 1), right.flatten(), ignore_index=-1)
    return loss


def varied(rng: np.random.Generator, rows: np.ndarray) -> np.ndarray:
    """Copies of inputs as another mix of the music could have: other dynamics, other onsets."""
    rows = rows.copy()
    level, onset = rng.uniform(0.6, 1.2), rng.uniform(0.6, 1.3)
    for first in (0, VALUES, 2 * VALUES):
        rows[:, first : first + BANDS] *= level
        rows[:, first + BANDS : first + 2 * BANDS] *= onset
    rows[:, 3 * VALUES : 3 * VALUES + 1 + len(LAGS)] *= rng.uniform(0.7, 1.15)
    if rng.random() < 0.15:
        rows[:, -2:] = np.roll(rows[:, -2:], int(rng.integers(1, 4)), 0)
    return rows


def batch(rng: np.random.Generator, pieces: list, mean: np.ndarray, scale: np.ndarray) -> tuple[torch.Tensor, list[torch.Tensor]]:
    """Normalised inputs and targets of parts of random pieces, -1 after their ends."""
    rows, wanted = [], [[] for _ in range(4)]
    for index in rng.choice(len(pieces), BATCH, replace=False):
        part, right = pieces[index]
        begin = int(rng.integers(0, max(len(part) - SEQUENCE, 0) + 1)) if rng.random() < 0.5 else 0
        part = (varied(rng, part[begin : begin + SEQUENCE]) - mean) * scale
        part[:, : 3 * VALUES + 1] += rng.normal(0, 0.15, (len(part), 3 * VALUES + 1))
        rest = SEQUENCE - len(part)
        rows.append(np.pad(part, ((0, rest), (0, 0))))
        for all_rows, row in zip(wanted, right):
            all_rows.append(np.pad(row[begin : begin + SEQUENCE], (0, rest), constant_values=-1))
    return torch.tensor(np.array(rows), dtype=torch.float32), [torch.tensor(np.array(rows)).long() for rows in wanted]


def train(pieces: list, held: list, steps: int) -> tuple[Network, np.ndarray, np.ndarray]:
    """Trains a network on `pieces` and prints its loss on them and on `held`. Returns it with the mean and the scale of its inputs."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    rows = np.concatenate([rows for rows, _ in pieces])
    mean, scale = rows.mean(0), 1 / (rows.std(0) + 0.05)
    network = Network(len(mean))
    optimiser = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=0.1)
    for step in range(steps):
        loss = loss_of(network.train(), *batch(rng, pieces, mean, scale))
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        if step % 200 == 199 or step == steps - 1:
            with torch.no_grad():
                other = np.mean([loss_of(network.eval(), *batch(rng, held, mean, scale)).item() for _ in range(4)])
            print(f"step {step + 1}: {loss.item():.3f}, held out {other:.3f}", flush=True)
    return network.eval(), mean, scale


def export(network: Network, mean: np.ndarray, scale: np.ndarray, path: Path) -> None:
    """Writes the file that `network.rs` reads."""
    gates = network.gates
    tensors = {"mean": mean, "scale": scale}
    layers = {
        "first": (network.first.weight, network.first.bias),
        "gates.input": (gates.weight_ih_l0, gates.bias_ih_l0),
        "gates.state": (gates.weight_hh_l0, gates.bias_hh_l0),
        "last": (network.last.weight, network.last.bias),
    }
    for name, (weight, bias) in layers.items():
        tensors[f"{name}.weight"], tensors[f"{name}.bias"] = weight.detach().numpy().T, bias.detach().numpy()
    save_file({name: np.ascontiguousarray(values, dtype=np.float16) for name, values in tensors.items()}, path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pieces", type=int, default=1000)
    parser.add_argument("--steps", type=int, default=2400)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    paths = [arguments.folder / f"{30_000 + number}.npz" for number in range(arguments.pieces)]
    for path in paths:
        if not path.exists():
            make_piece(path, int(path.stem))
    # Each piece once from its beginning, and twice from somewhere in it.
    begins = np.random.default_rng(7)
    read_all = lambda part: [read(path, begin) for path in part for begin in (0, *begins.integers(0, 150, 2))]
    count = len(paths) // 10
    export(*train(read_all(paths[count:]), read_all(paths[:count]), arguments.steps), arguments.output)
