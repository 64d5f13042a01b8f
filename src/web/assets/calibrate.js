// Calibration at the venue: a flash and a click on the show's beat, and controls for input latency, output offsets and input channels.
// In: states, vitals. Out: messages to the show.

const STEPS = [-10, -1, 1, 10];
const LATENCY_MS_MAX = 500;
const OFFSET_MS_MAX = 500;
// A click is scheduled this long before it sounds.
const CLICK_AHEAD_MS = 150;
// The fastest message of this period gives the clock offset.
const CLOCK_WINDOW_MS = 4000;

/** Estimates the show's clock. Messages arrive late, never early, so the message with the smallest delay of the last seconds counts. */
function makeClock() {
  let [best, next, turned] = [Infinity, Infinity, 0];
  let latest = null;
  return {
    update(state, now) {
      latest = state;
      const offset = now - state.t * 1000;
      if (now - turned > CLOCK_WINDOW_MS) [best, next, turned] = [next, Infinity, now];
      next = Math.min(next, offset);
      best = Math.min(best, next);
    },
    /** The beat at `time` (a value of `performance.now()`); null without a tempo. */
    beat(time) {
      if (!latest?.bpm) return null;
      return latest.beat + ((time - best) / 1000 - latest.t) * latest.bpm / 60;
    },
    /** The time of `beat`, in terms of `performance.now()`. */
    time(beat) {
      return best + (latest.t + (beat - latest.beat) * 60 / latest.bpm) * 1000;
    },
    isDownbeat: (beat) => (latest.bar + beat - Math.floor(latest.beat)) % latest.beats_per_bar === 0,
  };
}

/** Plays clicks on the beats. Browsers allow sound only after a user action. */
function makeClicker(clock) {
  let audio = null;
  let last = -Infinity;

  function click(beat) {
    const { contextTime, performanceTime } = audio.getOutputTimestamp();
    const at = contextTime + (clock.time(beat) - performanceTime) / 1000;
    if (at < audio.currentTime) return;
    const [tone, loudness] = [audio.createOscillator(), audio.createGain()];
    tone.frequency.value = clock.isDownbeat(beat) ? 1760 : 1320;
    loudness.gain.setValueAtTime(0.5, at);
    loudness.gain.exponentialRampToValueAtTime(0.001, at + 0.04);
    tone.connect(loudness).connect(audio.destination);
    tone.start(at);
    tone.stop(at + 0.05);
  }

  return {
    turn(on) {
      if (on) (audio ??= new AudioContext()).resume();
      else audio?.suspend();
    },
    /** Schedules the next click once. Returns the last scheduled beat. */
    run(now) {
      if (audio?.state !== 'running') return 0;
      const beat = Math.floor(clock.beat(now + CLICK_AHEAD_MS));
      if (beat !== last && clock.time(beat) > now) {
        last = beat;
        click(beat);
      }
      return last;
    },
  };
}

/** A row with a value and buttons that change it by steps; calls `set(ms)` on each change. */
function makeStepper(name, [least, most], set) {
  const row = document.createElement('div');
  row.className = 'dial';
  row.setAttribute('role', 'group');
  row.setAttribute('aria-label', name);
  const caption = Object.assign(document.createElement('span'), { textContent: name });
  const value = document.createElement('output');
  let ms = 0;
  let changedAt = -Infinity;
  const show = () => { value.textContent = `${Math.round(ms * 10) / 10} ms`; };
  const buttons = STEPS.map((step) => {
    const words = `${Math.abs(step)} milliseconds ${step < 0 ? 'less' : 'more'}`;
    const button = Object.assign(document.createElement('button'), { type: 'button', textContent: step < 0 ? `−${-step}` : `+${step}` });
    button.setAttribute('aria-label', words);
    button.addEventListener('click', () => {
      ms = Math.min(Math.max(ms + step, least), most);
      changedAt = performance.now();
      show();
      set(ms);
    });
    return button;
  });
  row.append(caption, ...buttons.slice(0, 2), value, ...buttons.slice(2));
  return {
    row,
    /** Shows the value of the show, unless the user changed it in the last 1.5 s. */
    update(value) {
      if (performance.now() - changedAt < 1500) return;
      ms = value;
      show();
    },
  };
}

/** A row of buttons with levels, one for each input channel; calls `choose(numbers)` on each change; an empty list means all channels. */
function makeChannels(count, choose) {
  const row = document.createElement('div');
  row.className = 'channels';
  row.setAttribute('role', 'group');
  row.setAttribute('aria-label', 'input channels');
  let changedAt = -Infinity;
  const buttons = Array.from({ length: count }, (_, i) => {
    const button = Object.assign(document.createElement('button'), { type: 'button' });
    const level = document.createElement('small');
    button.append(`${i + 1} `, level);
    button.addEventListener('click', () => {
      changedAt = performance.now();
      button.setAttribute('aria-pressed', button.getAttribute('aria-pressed') !== 'true');
      const chosen = buttons.flatMap((it, channel) => (it.getAttribute('aria-pressed') === 'true' ? [channel + 1] : []));
      choose(chosen.length === count ? [] : chosen);
    });
    return button;
  });
  row.append(...buttons);
  return {
    row,
    update(channels) {
      channels.forEach(({ peak, chosen }, i) => {
        const db = 20 * Math.log10(Math.max(peak, 1e-6));
        buttons[i].querySelector('small').textContent = db < -100 ? 'silent' : `${db.toFixed(0)} dB`;
        buttons[i].dataset.hot = peak >= 1;
        if (performance.now() - changedAt > 1500) buttons[i].setAttribute('aria-pressed', chosen);
      });
    },
  };
}

/** Fills `dialog`; `send(message)` sends a message. Returns `{ open, state, vitals, showMessage }`. */
export function makeCalibrate(dialog, send) {
  const $ = (name) => dialog.querySelector(`[data-part="${name}"]`);
  const clock = makeClock();
  const clicker = makeClicker(clock);
  let latency = null;
  let outputs = [];
  let channels = null;
  let known = '';

  function build(vitals) {
    const hasInput = vitals.input_latency_ms !== null;
    const text = JSON.stringify([hasInput, vitals.channels.length, vitals.outputs.map(({ kind, to }) => [kind, to])]);
    if (text === known) return;
    known = text;
    latency = hasInput ? makeStepper('input latency', [0, LATENCY_MS_MAX], (ms) => send({ input_latency: ms })) : null;
    $('hear').hidden = !hasInput;
    $('latency').replaceChildren(...latency ? [latency.row] : []);
    channels = vitals.channels.length > 1 ? makeChannels(vitals.channels.length, (chosen) => send({ channels: chosen })) : null;
    $('channels').replaceChildren(...channels ? [channels.row] : []);
    outputs = vitals.outputs.map(({ kind, to }, output) =>
      makeStepper(`offset of ${kind} ${to}`, [-OFFSET_MS_MAX, OFFSET_MS_MAX], (ms) => send({ offset: { output, ms } })));
    $('outputs').replaceChildren(...outputs.map((dial) => dial.row));
    $('see').hidden = outputs.length === 0;
  }

  function draw(now) {
    if (!dialog.open) return;
    requestAnimationFrame(draw);
    const beat = clock.beat(now);
    if (beat === null) return;
    const phase = beat - Math.floor(beat);
    $('flash').style.setProperty('--light', Math.max(0, 1 - phase * 4).toFixed(3));
    $('flash').dataset.downbeat = clock.isDownbeat(Math.floor(beat));
    dialog.dataset.clicks = clicker.run(now);
  }

  $('click').addEventListener('click', () => {
    const on = $('click').getAttribute('aria-pressed') !== 'true';
    $('click').setAttribute('aria-pressed', on);
    clicker.turn(on);
  });
  $('keep').addEventListener('click', () => send({ keep: true }));
  $('close').addEventListener('click', () => dialog.close());
  dialog.addEventListener('close', () => {
    clicker.turn(false);
    $('click').setAttribute('aria-pressed', false);
  });

  return {
    open() {
      $('said').textContent = '';
      dialog.showModal();
      requestAnimationFrame(draw);
    },
    state: (state) => clock.update(state, performance.now()),
    vitals(vitals) {
      build(vitals);
      latency?.update(vitals.input_latency_ms);
      channels?.update(vitals.channels);
      vitals.outputs.forEach(({ offset_ms: ms }, output) => outputs[output].update(ms));
    },
    /** Shows the answer to a message in the dialog. */
    showMessage(message) {
      $('said').textContent = message;
    },
  };
}
