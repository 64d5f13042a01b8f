// Takes: records the live performer under a label. In: clicks, the state of the take, the beat. Out: messages to the show, a count-in.

const LENGTHS = [['8', '8 beats'], ['16', '16 beats'], ['32', '32 beats'], ['64', '64 beats'], ['', 'until stop']];
const BUSY = ['count_in', 'recording', 'building'];
const SAID = { count_in: 'counting in', recording: 'recording', building: 'adding the take to the show' };
const CLICK_S = 0.05;

function button(text) {
  return Object.assign(document.createElement('button'), { type: 'button', textContent: text });
}

/** A short tone. Without a click on the page before, browsers allow no sound, and this does nothing. */
function makeClick() {
  let audio = null;
  return {
    allow() { (audio ??= new AudioContext()).resume(); },
    play(isLast) {
      if (audio?.state !== 'running') return;
      const [tone, loudness] = [audio.createOscillator(), audio.createGain()];
      tone.frequency.value = isLast ? 1760 : 1320;
      loudness.gain.setValueAtTime(0.5, audio.currentTime);
      loudness.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + CLICK_S);
      tone.connect(loudness).connect(audio.destination);
      tone.start();
      tone.stop(audio.currentTime + CLICK_S);
    },
  };
}

/**
 * Fills `section` with the controls; `count` shows the count-in and the beats of the take; `send(message)` sends a message.
 * Returns `{ hello(message), start(label), take(message), beat(beat) }`.
 */
export function makeRecord(section, count, send) {
  const label = Object.assign(document.createElement('input'), { placeholder: 'label', maxLength: 64, autocomplete: 'off' });
  label.setAttribute('aria-label', 'Label of the take');
  const length = document.createElement('select');
  length.setAttribute('aria-label', 'Length of the take');
  length.append(...LENGTHS.map(([value, text]) => new Option(text, value)));
  length.value = '16';
  const [record, undo, rename, follow] = [button('record'), button('undo'), button('rename'), button('follow me')];
  undo.hidden = true;
  rename.hidden = true;
  const said = document.createElement('p');
  said.setAttribute('role', 'status');
  const row = Object.assign(document.createElement('div'), { className: 'row' });
  row.append(label, length);
  const buttons = Object.assign(document.createElement('div'), { className: 'row' });
  follow.title = 'Dance on from the motion that is most similar to the performer\'s pose';
  buttons.append(record, undo, rename, follow);
  const takes = Object.assign(document.createElement('p'), { hidden: true });
  takes.dataset.part = 'takes';
  section.querySelector('[data-part="record"]').replaceChildren(row, buttons, said, takes);

  const click = makeClick();
  let now = { phase: 'idle', takes: [] };
  let shown = '';

  function start(name) {
    click.allow();
    const wanted = { label: name };
    if (length.value !== '') wanted.beats = Number(length.value);
    send({ record: wanted });
  }

  record.addEventListener('click', () => {
    if (BUSY.includes(now.phase)) return send({ record_stop: true });
    if (label.value.trim() === '') {
      said.textContent = 'Give the take a label first.';
      return label.focus();
    }
    return start(label.value.trim());
  });
  label.addEventListener('keydown', (event) => event.key === 'Enter' && record.click());
  follow.addEventListener('click', () => send({ follow: true }));
  undo.addEventListener('click', () => send({ record_undo: true }));
  rename.addEventListener('click', () => {
    if (label.value.trim() !== '') send({ record_rename: label.value.trim() });
  });

  return {
    /** Takes the static data of the show: without a live performer the controls are hidden. */
    hello(message) {
      section.hidden = !message.takes;
      document.querySelector('[data-to="setup-record"]').hidden = !message.takes;
    },
    /** Records a take with the label `name`; the length is that of the controls. */
    start(name) {
      label.value = name;
      start(name);
    },
    /** Takes the state of the take. */
    take(message) {
      now = message;
      const isBusy = BUSY.includes(now.phase);
      record.textContent = isBusy ? 'stop' : 'record';
      record.setAttribute('aria-pressed', isBusy);
      const last = now.takes.at(-1);
      undo.hidden = last === undefined;
      undo.title = `Take "${last}" out of the show`;
      rename.hidden = last === undefined;
      rename.title = `Give "${last}" the label above`;
      takes.hidden = last === undefined;
      takes.textContent = `Takes of this show: ${now.takes.join(', ')}`;
      said.dataset.phase = now.phase;
      said.textContent = now.message || SAID[now.phase] || '';
    },
    /** Shows the beats that are left at the beat `beat` of the show. */
    beat(beat) {
      const before = Math.ceil(now.first_beat - beat);
      let text = '';
      if (now.phase === 'count_in' && before > 0) text = String(before);
      if (now.phase === 'recording') {
        const left = now.beats === null ? Math.floor(beat - now.first_beat) + 1 : Math.ceil(now.first_beat + now.beats - beat);
        text = `● ${Math.max(left, 0)}`;
      }
      if (text === shown) return;
      if (now.phase === 'count_in' && before <= 4) click.play(before === 1);
      shown = text;
      count.hidden = text === '';
      count.textContent = text;
      count.dataset.phase = now.phase;
      // Starts the flash again.
      count.style.animation = 'none';
      void count.offsetWidth;
      count.style.animation = '';
    },
  };
}
