// The beat grid of a song: seconds to beats (beat 0 is the first beat) and back. In: beats of the program. Out: numbers. Pure.

// A hit may come this late after its beat.
const LATE_BEATS = 0.25;
const BARS = { bar: 1, '2bars': 2, '4bars': 4 };

/** `song` is the object in the answer of `/about`. */
export function makeGrid(song) {
  const { beats: times, bars, counted_from: zero } = song;
  const last = times.length - 1;
  /** Index of the last beat at or before `seconds` that has a following beat. */
  function before(seconds) {
    let [from, to] = [0, Math.max(last - 1, 0)];
    while (from < to) {
      const middle = Math.ceil((from + to) / 2);
      if (times[middle] <= seconds) from = middle;
      else to = middle - 1;
    }
    return from;
  }
  const periodAt = (i) => (last > 0 ? times[i + 1] - times[i] : 0.5);
  const startOf = (beat) => bars[beat + zero] === 0;
  // Number of bar lines up to each beat.
  let lines = 0;
  const linesTo = bars.map((position) => (position === 0 ? ++lines : lines));

  const grid = {
    times,
    /** Last beat of the song that can carry a cue; the first is 0. */
    lastBeat: Math.max(song.cue_beats - 1, 0),
    /** Length of most bars, in beats. */
    beatsPerBar: song.beats_per_bar,
    numberOf: (i) => i - zero,
    isBar: startOf,
    /** Number of the bar of a beat (the bar of beat 0 is bar 1), and the beat's place in the bar, from 1. */
    placeOf(beat) {
      const i = Math.min(Math.max(Math.floor(beat) + zero, 0), Math.max(last, 0));
      return { bar: (linesTo[i] ?? 0) - (linesTo[zero] ?? 0) + 1, position: (bars[i] ?? 0) + 1 };
    },
    beatAt(seconds) {
      const i = before(seconds);
      return i - zero + (seconds - times[i]) / periodAt(i);
    },
    timeAt(beat) {
      const i = Math.min(Math.max(Math.floor(beat) + zero, 0), Math.max(last - 1, 0));
      return times[i] + (beat + zero - i) * periodAt(i);
    },
    bpmAt(seconds) {
      return 60 / periodAt(before(seconds));
    },
    clamp: (beat) => Math.min(Math.max(beat, 0), grid.lastBeat),
    /** The beat at which a hit at `beat` is written. */
    snap(beat, how) {
      if (how === 'nearest') return grid.clamp(Math.round(beat));
      const next = Math.max(Math.ceil(beat - LATE_BEATS), 0);
      if (!BARS[how]) return grid.clamp(next);
      const starts = [];
      for (let n = 0; n <= grid.lastBeat; n++) if (startOf(n)) starts.push(n);
      return grid.clamp(starts.find((start, i) => i % BARS[how] === 0 && start >= next) ?? starts.at(-1) ?? next);
    },
  };
  return grid;
}
