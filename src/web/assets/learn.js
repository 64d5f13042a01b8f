// MIDI learn: the user chooses an action, then moves a control. In: labels, answers of the show. Out: messages to the show.

// Commands of the show and their captions.
const COMMANDS = [
  ['!panic', 'panic'], ['!hold', 'hold'], ['!release', 'release'], ['!intensity', 'intensity (knob or fader)'],
  ['!follow', 'follow the live performer'], ['!intensity release', 'intensity: follow the music'], ['!tap', 'tap'], ['!half', 'half'], ['!double', 'double'], ['!downbeat', 'downbeat'],
  ['!nudge -10', 'beats 10 ms earlier'], ['!nudge 10', 'beats 10 ms later'],
];
const RECORD_COMMANDS = [['!record_stop', 'stop the take'], ['!record_undo', 'undo the last take']];
const MODES = [['trigger', '8 beats'], ['gate', 'while held'], ['toggle', 'toggle'], ['repeat', 'loop while held']];
const RECORD = ['record', 'record takes'];

function choice(label, options) {
  const select = document.createElement('select');
  select.setAttribute('aria-label', label);
  select.append(...options.map(([value, text]) => new Option(text, value)));
  return select;
}

/** Fills `element` with the controls; `send(message)` sends a message. Returns `{ labels(names, takes, scenes), showAnswer(answer) }`. */
export function makeLearn(element, send) {
  const what = choice('Action of the MIDI control', COMMANDS);
  const mode = choice('Launch mode of the MIDI control', MODES);
  const button = Object.assign(document.createElement('button'), { type: 'button', textContent: 'learn' });
  button.setAttribute('aria-pressed', false);
  const answerText = document.createElement('p');
  answerText.setAttribute('role', 'status');
  element.replaceChildren(what, mode, button, answerText);

  const isLabel = () => !what.value.startsWith('!');
  const fit = () => { mode.disabled = !isLabel(); };
  what.addEventListener('change', fit);
  fit();

  function waiting(on) {
    button.setAttribute('aria-pressed', on);
    button.textContent = on ? 'cancel' : 'learn';
  }

  button.addEventListener('click', () => {
    if (button.getAttribute('aria-pressed') === 'true') return send({ learn: null });
    const learn = { label: what.value };
    if (isLabel() && mode.value === 'record') learn.record = true;
    else if (isLabel()) learn.mode = mode.value;
    return send({ learn });
  });

  return {
    /** Takes the names of the labels and of the scenes; `takes` is true if the show records takes. */
    labels(names, takes, scenes) {
      const chosen = what.value;
      const recalls = scenes.map((name) => [`!scene ${name}`, `scene ${name}`]);
      const ends = scenes.length ? [['!scene_end', 'end the scene']] : [];
      const commands = [...recalls, ...ends, ...COMMANDS, ...(takes ? RECORD_COMMANDS : [])];
      what.replaceChildren(...names.map((name) => new Option(name, name)), ...commands.map(([value, text]) => new Option(text, value)));
      const wanted = mode.value;
      mode.replaceChildren(...[...MODES, ...(takes ? [RECORD] : [])].map(([value, text]) => new Option(text, value)));
      if ([...mode.options].some((option) => option.value === wanted)) mode.value = wanted;
      if ([...what.options].some((option) => option.value === chosen)) what.value = chosen;
      if (names.length > 0) what.value = names[0];
      fit();
    },
    showAnswer(answer) {
      waiting(answer.state === 'waiting' || answer.state === 'refused');
      answerText.dataset.state = answer.state;
      answerText.textContent = answer.message;
    },
  };
}
