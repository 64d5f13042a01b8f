// The setup of a show: audio input, renderer, motions, saving. In: the setup's state. Out: requests that change it.

import { droppedFiles, labelOf } from './upload.js';

const POLL_MS = 500;
// While the show starts again, its server does not answer.
const RETRIES_MAX = 60;
const SILENT_DB = -75;

/** Makes the setup in `panel`, the content of `drawer`. Returns `{ opened(), hello(message), connection(name), level(share, db) }`. */
export function makeSetup(panel, drawer) {
  const part = (name) => panel.querySelector(`[data-part="${name}"]`);
  let state = null;
  let inputs = [];
  let isHere = false;
  let isPolling = false;
  let isHeard = null;

  /** Sends a request. Returns the response's JSON; throws its message. */
  async function request(method, path, body) {
    let response;
    try {
      response = await fetch(`/setup/${path}`, { method, body: body instanceof Blob || !body ? body : JSON.stringify(body) });
    } catch {
      throw new Error('no connection to the show; try again');
    }
    const text = await response.text();
    let json;
    try {
      json = JSON.parse(text);
    } catch {
      throw new Error(text || `the show answers with the error ${response.status}`);
    }
    if (!response.ok) throw Object.assign(new Error(json.message), { status: response.status });
    return json;
  }

  function say(name, text, wrong = false) {
    part(name).textContent = text;
    part(name).dataset.wrong = wrong;
  }

  /** Runs `work`; shows the message of an error in the part `name`. Returns true without an error. */
  async function attempt(name, work) {
    try {
      await work();
      return true;
    } catch (error) {
      say(name, error.message, true);
      return false;
    }
  }

  async function change(method, path, body) {
    show(await request(method, path, body));
    if (!state.ready) poll();
  }

  /** Reads the state until the show runs and no motions are being built. */
  async function poll() {
    if (isPolling) return;
    isPolling = true;
    for (let failures = 0; failures < RETRIES_MAX;) {
      await new Promise((go) => setTimeout(go, POLL_MS));
      try {
        show(await request('GET', 'state'));
        failures = 0;
        if (state.ready && state.motions.state !== 'running') break;
      } catch (error) {
        if (error.status === 403) break;
        failures += 1;
      }
    }
    isPolling = false;
  }

  function showInputs() {
    const known = inputs.some(({ value }) => value === state.input);
    const all = known ? inputs : [...inputs, { value: state.input, name: state.input, kind: 'input' }];
    const group = (label, kind, sign) => {
      const options = all.filter((input) => input.kind === kind).map(({ value, name, host, free }) => {
        const about = [host && inputs.filter((other) => other.name === name).length > 1 && host, free === false && 'in use'].filter(Boolean);
        return new Option(`${sign}${name}${about.length ? ` (${about.join(', ')})` : ''}`, value);
      });
      const element = Object.assign(document.createElement('optgroup'), { label });
      element.append(...options);
      return options.length ? [element] : [];
    };
    part('input').replaceChildren(...group('What the computer plays', 'computer', '\u266A '), ...group('Microphones and other inputs', 'input', ''));
    part('input').value = state.input;
  }

  function showRenderers() {
    if (!part('renderer').options.length) {
      const none = new Option('choose your program', '');
      part('renderer').replaceChildren(none, ...state.renderers.map(({ id, name }) => new Option(name, id)));
    }
    part('renderer').value = state.renderer ?? '';
    const chosen = state.renderers.find(({ id }) => id === state.renderer);
    const port = state.output.to.split(':').pop();
    say('hint', chosen ? chosen.hint.replaceAll('{port}', port) : '');
    if (document.activeElement !== part('to')) part('to').value = state.output.to;
    say('sent', state.output.kind ? `The poses go to ${state.output.to} (${state.output.kind}).` : '');
  }

  function showMotions() {
    const { files, state: progress, share, text, warnings } = state.motions;
    part('progress').hidden = progress !== 'running';
    part('progress').value = share;
    const words = {
      none: files.length ? 'These files are not built yet.' : '',
      running: 'The motions are being read and joined. The dance continues meanwhile.',
      done: `The dancer dances your motions: ${text}.`,
      failed: `The motions are not used: ${text}.`,
    };
    say('built', words[progress], progress === 'failed');
    const line = (main, problem) => {
      const item = document.createElement('li');
      item.textContent = problem ? `${main}: ${problem}` : main;
      item.dataset.wrong = Boolean(problem);
      return item;
    };
    part('list').replaceChildren(...files.map(({ file, problem }) => line(file, problem)), ...warnings.map((warning) => line(warning)));
    part('rebuild').hidden = !state.has_import_page;
    part('rebuild').disabled = progress === 'running';
    part('remove').hidden = !files.length && !state.own_motions;
    part('remove').disabled = progress === 'running';
  }

  function show(next) {
    const isFirst = !state;
    state = next;
    part('steps').hidden = false;
    say('problem', state.problem ?? '', true);
    if (document.activeElement !== part('input')) showInputs();
    showRenderers();
    showMotions();
    if (isFirst || state.name) {
      part('folder').value = isFirst || !part('folder').value ? state.folder : part('folder').value;
      if (isFirst && state.name) part('name').value = state.name;
    }
  }

  /** Shows or hides the parts of the drawer that set up the show. */
  function setParts(shown) {
    for (const element of panel.querySelectorAll('[data-for="setup"]')) element.hidden = !shown;
  }

  async function load() {
    await attempt('problem', async () => {
      show(await request('GET', 'state'));
      if (!state.ready || state.motions.state === 'running') poll();
      inputs = await request('GET', 'inputs');
      showInputs();
      listShows();
    });
    if (!state) setParts(false);
  }

  async function listShows() {
    try {
      const names = await request('POST', 'shows', { folder: part('folder').value });
      panel.querySelector('datalist').replaceChildren(...names.map((name) => new Option(name)));
    } catch {
      panel.querySelector('datalist').replaceChildren();
    }
  }

  async function add(found) {
    const typed = part('label').value.trim();
    const refused = [];
    for (const [i, { file, folders }] of found.entries()) {
      const label = typed || labelOf(file, folders);
      say('built', `${i + 1} of ${found.length}: ${file.name}`);
      try {
        await request('POST', `motions/${encodeURIComponent(label)}/${encodeURIComponent(file.name)}`, file);
      } catch (error) {
        refused.push(error.message);
      }
    }
    part('label').value = '';
    const built = found.length > refused.length && await attempt('built', () => change('POST', 'build'));
    if (built) poll();
    if (refused.length) say('problem', refused.join(' '), true);
  }

  async function choose(id, to) {
    await attempt('sent', () => change('POST', 'renderer', { id, to }));
  }

  async function save(replace) {
    part('replace').hidden = true;
    const wanted = { folder: part('folder').value, name: part('name').value, replace };
    try {
      const { path } = await request('POST', 'save', wanted);
      say('saved', `Saved. Run it again with: corybant run "${path}", or open it here.`);
      listShows();
    } catch (error) {
      part('replace').hidden = error.status !== 409;
      say('saved', error.message, true);
      if (error.status === 409) part('replace').focus();
    }
  }

  part('pads').addEventListener('click', () => drawer.close());
  part('input').addEventListener('change', async () => {
    say('sound', 'opening the input');
    const wanted = part('input').value;
    const opened = await attempt('sound', () => change('POST', 'input', { input: wanted }));
    isHeard = null;
    if (opened) say('sound', '');
    else part('input').value = state.input;
  });
  part('refresh').addEventListener('click', () => attempt('sound', async () => {
    inputs = await request('GET', 'inputs');
    showInputs();
    say('sound', `${inputs.length} inputs found`);
  }));
  part('renderer').addEventListener('change', () => {
    const chosen = state.renderers.find(({ id }) => id === part('renderer').value);
    if (!chosen) return;
    part('to').value = chosen.to;
    choose(chosen.id, chosen.to);
  });
  const send = () => choose(part('renderer').value || 'other-vmc', part('to').value);
  part('send').addEventListener('click', send);
  part('to').addEventListener('keydown', (event) => event.key === 'Enter' && send());
  part('files').addEventListener('change', () => {
    const found = [...part('files').files].map((file) => ({ file, folders: [] }));
    part('files').value = '';
    if (found.length) add(found);
  });
  const drop = part('drop');
  drop.addEventListener('dragover', (event) => {
    event.preventDefault();
    drop.dataset.over = true;
  });
  drop.addEventListener('dragleave', () => { drop.dataset.over = false; });
  drop.addEventListener('drop', async (event) => {
    event.preventDefault();
    drop.dataset.over = false;
    const found = await droppedFiles(event.dataTransfer);
    if (found.length) add(found);
  });
  // A file that is dropped beside must not replace the page.
  for (const name of ['dragover', 'drop']) addEventListener(name, (event) => isHere && event.preventDefault());
  part('import').addEventListener('click', async () => {
    // Opened at once: a browser blocks a page that opens after a wait.
    const tab = window.open('', '_blank');
    const opened = await attempt('built', async () => {
      const { link } = await request('POST', 'import');
      if (!tab) throw new Error('the browser has blocked the import page: allow pop-ups for this page');
      tab.opener = null;
      tab.location = link;
      show(await request('GET', 'state'));
    });
    if (!opened) tab?.close();
  });
  part('rebuild').addEventListener('click', async () => {
    if (await attempt('built', () => change('POST', 'build'))) poll();
  });
  part('remove').addEventListener('click', () => attempt('built', () => change('DELETE', 'motions')));
  part('save').addEventListener('click', () => save(false));
  part('replace').addEventListener('click', () => save(true));
  part('name').addEventListener('keydown', (event) => event.key === 'Enter' && save(false));
  part('name').addEventListener('input', () => { part('replace').hidden = true; });
  part('folder').addEventListener('change', listShows);
  part('open').addEventListener('click', () => attempt('saved', async () => {
    await change('POST', 'open', { folder: part('folder').value, name: part('name').value });
    say('saved', `${part('name').value} is open.`);
  }));
  part('quit').addEventListener('click', async () => {
    if (await attempt('problem', () => request('POST', 'quit'))) {
      isHere = false;
      part('steps').hidden = true;
      say('problem', 'The show has ended. You can close this page.');
    }
  });

  return {
    /** Takes the static data of the show. The first time, opens the drawer of a show that the page can set up. */
    hello(message) {
      setParts(message.setup);
      part('steps').hidden = false;
      const isFirst = message.setup && !isHere;
      isHere = message.setup;
      if (isFirst && !drawer.isOpen()) drawer.open();
      else if (drawer.isOpen()) this.opened();
    },
    /** Reads the state of the setup after the drawer was opened. */
    opened() {
      if (isHere) load();
    },
    connection(name) {
      panel.dataset.connection = name;
    },
    /** Shows the level of the input: `share` of the meter, `db` decibels. */
    level(share, db) {
      if (panel.hidden) return;
      const level = part('level');
      level.style.setProperty('--fill', share.toFixed(3));
      level.setAttribute('aria-valuenow', Math.min(Math.max(db, -60), 0).toFixed(0));
      const text = db <= -100 ? 'silent' : `${db.toFixed(0)} dB`;
      if (level.querySelector('.value').textContent !== text) level.querySelector('.value').textContent = text;
      if (isHeard !== db > SILENT_DB && part('sound').dataset.wrong !== 'true') {
        isHeard = db > SILENT_DB;
        say('sound', isHeard ? 'The show hears sound.' : 'The show hears nothing yet: start your music, or choose another input.');
      }
    },
  };
}
