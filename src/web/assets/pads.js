// The pads: one for each label; idle, queued or dancing. In: labels, states. Out: calls of `press(label, state)` and `lift(label)`.

// Without the letters of the tempo commands.
const KEYS = '1234567890acefgijklmnopqrsuvwxyz';
// Of a pad without a `/` in its name.
const PLAIN_GROUP = 'pads';
// Greatest number of characters of a name that is written on one line.
const ONE_LINE = 13;
const HIT_MS = 140;
const CLICK_AFTER_MS = 400;
const SWIPE_PX = 8;
// A finger that rests this long wants to hold the pad.
const REST_MS = 180;

/** Returns true if a swipe over `element` can scroll something. */
function canScroll(element) {
  for (let around = element.parentElement; around; around = around.parentElement) {
    if (around.scrollHeight > around.clientHeight + 1 && /auto|scroll/.test(getComputedStyle(around).overflowY)) return true;
  }
  return false;
}

/**
 * Calls `act` when a finger, mouse or pen presses `button`, and also on a click of a keyboard or screen reader. Calls `release` when the finger,
 * mouse or pen is released, also outside of the button.
 *
 * `restMs`, if given, returns the time after which a finger that rests on the button presses it. Where the finger can scroll, an earlier release
 * presses the button, and a swipe does not. A finger that rested no longer scrolls, so that no swipe presses a button.
 */
export function onPress(button, act, release = () => {}, restMs = null) {
  let touchedAt = -Infinity;
  let waiting = null;
  let isHeld = false;
  const touch = () => { touchedAt = performance.now(); };
  const stopWaiting = () => {
    clearTimeout(waiting?.timer);
    waiting = null;
  };
  function press(pointer) {
    stopWaiting();
    flash(button);
    button.setPointerCapture(pointer);
    act();
  }
  button.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    touch();
    if (event.pointerType !== 'touch' || !restMs || !canScroll(button)) return press(event.pointerId);
    stopWaiting();
    const rest = restMs();
    const hold = () => {
      isHeld = true;
      press(event.pointerId);
    };
    const timer = Number.isFinite(rest) ? setTimeout(hold, rest) : 0;
    waiting = { pointer: event.pointerId, x: event.clientX, y: event.clientY, timer };
    return undefined;
  });
  button.addEventListener('pointermove', (event) => {
    if (waiting?.pointer === event.pointerId && Math.hypot(event.clientX - waiting.x, event.clientY - waiting.y) > SWIPE_PX) stopWaiting();
  });
  button.addEventListener('pointercancel', stopWaiting);
  button.addEventListener('pointerup', (event) => {
    touch();
    if (waiting?.pointer === event.pointerId) press(event.pointerId);
  });
  button.addEventListener('lostpointercapture', () => {
    isHeld = false;
    release();
  });
  if (restMs) button.addEventListener('touchmove', (event) => isHeld && event.cancelable && event.preventDefault(), { passive: false });
  button.addEventListener('click', () => {
    // This click ends a press that already called `act`.
    if (performance.now() - touchedAt < CLICK_AFTER_MS) return;
    flash(button);
    act();
  });
}

/** Highlights `button` briefly. */
export function flash(button) {
  button.classList.add('hit');
  setTimeout(() => button.classList.remove('hit'), HIT_MS);
}

/** The group and the short name of the pad `label`: a dancer or the first part of a label, and the rest. */
export function partsOf(label) {
  const cut = label.indexOf('/');
  return cut < 0 ? [PLAIN_GROUP, label] : [label.slice(0, cut), label.slice(cut + 1)];
}

/** Fills `element` with a pad for each label; calls `lift(label)` when a pad is released. `isHeld()` returns true if it matters how long a pad is
 *  pressed. Returns `{ elements, show(states, notes), paint(group, colour), key, keyUp }`: `states[label]` is `idle`, `queued` or `dancing`, `notes[label]` is the text below the
 *  label's name. */
export function makePads(element, labels, { press, lift, isHeld }) {
  const pads = labels.map((label, i) => {
    const pad = document.createElement('button');
    pad.type = 'button';
    pad.className = 'pad';
    pad.dataset.label = pad.title = label;
    const [group, short] = partsOf(label);
    pad.dataset.group = group;
    const name = document.createElement('span');
    name.className = 'name';
    name.textContent = short;
    if (short !== label) name.prepend(Object.assign(document.createElement('small'), { textContent: group }), ' ');
    const isLong = label.length > ONE_LINE;
    name.dataset.long = isLong;
    name.style.setProperty('--letters', Math.max(4, isLong ? Math.max(...label.split(/[\s/-]+/).map((word) => word.length)) : label.length));
    const state = document.createElement('span');
    state.className = 'state';
    const key = document.createElement('kbd');
    key.dataset.key = KEYS[i] ?? '';
    if (KEYS[i]) pad.setAttribute('aria-keyshortcuts', KEYS[i]);
    pad.append(name, ' ', state, key);
    onPress(pad, () => press(label, pad.dataset.state), () => lift(label), () => (isHeld() ? REST_MS : Infinity));
    return pad;
  });
  element.replaceChildren(...pads);

  function show(states, notes) {
    pads.forEach((pad, i) => {
      if (pad.dataset.state === states[i] && pad.dataset.note === notes[i]) return;
      const [state, note] = [pad.dataset.state, pad.dataset.note] = [states[i], notes[i]];
      // A narrow pad shows the number without its unit.
      const words = note.split(/( beats?)/).map((word, n) => (n % 2 ? Object.assign(document.createElement('small'), { textContent: word }) : word));
      pad.querySelector('.state').replaceChildren(...words);
      pad.setAttribute('aria-pressed', state === 'dancing');
    });
  }
  show(labels.map(() => 'idle'), labels.map(() => ''));

  const place = (key) => (key.length === 1 && pads[KEYS.indexOf(key.toLowerCase())] ? KEYS.indexOf(key.toLowerCase()) : null);
  return {
    /** The pads, one for each label. */
    elements: pads,
    show,
    /** Colours the pads of `group`; null for no colour. */
    paint(group, colour) {
      for (const pad of pads.filter((pad) => pad.dataset.group === group)) {
        pad.dataset.painted = Boolean(colour);
        pad.style.setProperty('--group', colour ?? '');
        pad.style.setProperty('--tint', colour ? `${colour}2e` : '');
      }
    },
    /** Presses the pad with the shortcut `key`, if any. */
    key(key) {
      const i = place(key);
      if (i === null) return;
      flash(pads[i]);
      press(labels[i], pads[i].dataset.state);
    },
    /** Releases that pad. */
    keyUp(key) {
      const i = place(key);
      if (i !== null) lift(labels[i]);
    },
  };
}
