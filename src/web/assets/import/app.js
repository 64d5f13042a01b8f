// The import page. In: motion files from the user, the program's reports on them. Out: files, settings, the command to build the graph.

import { poseAt, unpack } from '../score/dance.js';
import { droppedFiles, labelOf } from '../upload.js';
import { make, makeClip, showList } from './clip.js';
import { server } from './requests.js';

const POLL_MS = 300;

const $ = (id) => document.getElementById(id);
const still = matchMedia('(prefers-reduced-motion: reduce)');
const cards = new Map();
let state = null;
let thumbsOf = -1;
let isPolling = false;
let isUploading = false;
let dance = null;
let stage = null;
let danceAt = 0;
let wasBuilding = false;
let isTakingDance = false;

function say(id, text, wrong = false) {
  if ($(id).textContent !== text) $(id).textContent = text;
  $(id).dataset.wrong = wrong;
}

/** Runs `work`; shows the message of an error in the element `id`. */
async function attempt(id, work) {
  try {
    await work();
    return true;
  } catch (error) {
    say(id, error.message, true);
    return false;
  }
}

/** Shows the state `next` and reads it again while the program works. */
function take(next) {
  state = next;
  showFolder();
  showClips();
  showBuild();
  if (thumbsOf !== state.generation) showThumbs();
  if (state.busy) poll();
}

async function poll() {
  if (isPolling) return;
  isPolling = true;
  await new Promise((go) => setTimeout(go, POLL_MS));
  isPolling = false;
  if (!await attempt('notice', async () => take(await server.state()))) state.busy = false;
}

function showFolder() {
  say('folder', state.private ? 'New motions, not saved yet' : state.folder);
  $('keep').hidden = !state.private || !state.files.length;
  if (!$('to').value) $('to').value = state.saved_to;
  $('reading').hidden = state.reading === null || isUploading;
  $('reading').value = state.reading ?? 0;
  say('notice', state.problem ?? '', true);
  showList($('warnings'), state.warnings);
}

function showClips() {
  const there = new Set(state.files.map(({ file }) => file));
  for (const [path, card] of cards) {
    if (there.has(path)) continue;
    card.element.remove();
    cards.delete(path);
  }
  state.files.forEach((file, place) => {
    let card = cards.get(file.file);
    if (!card) {
      const remove = async () => {
        take(await server.remove(file.file));
        $('files').focus();
      };
      card = makeClip(file.file, async (settings) => take(await server.change(settings)), remove);
      cards.set(file.file, card);
      $('clips').insertBefore(card.element, $('clips').children[place] ?? null);
    }
    card.show(file, state.mirror);
  });
  const labels = [...new Set(state.files.map(({ label }) => label).filter(Boolean))].sort();
  if ($('labels').dataset.text !== labels.join('\n')) {
    $('labels').dataset.text = labels.join('\n');
    $('labels').replaceChildren(...labels.map((label) => make('option', { value: label })));
  }
  $('labelling').hidden = !state.files.length;
}

async function showThumbs() {
  const generation = state.generation;
  thumbsOf = generation;
  const thumbs = await server.thumbs().catch(() => ({}));
  if (generation !== thumbsOf) return;
  for (const [path, card] of cards) card.setThumb(thumbs[path]);
  document.body.dataset.thumbs = Object.keys(thumbs).length;
}

function showBuild() {
  const { state: progress, share, text, stale, dance: hasDance } = state.build;
  const isBuilding = progress === 'running';
  $('build').disabled = isBuilding || !state.files.length;
  $('building').hidden = !isBuilding;
  $('building').value = share;
  const words = {
    none: state.files.length ? `The graph will be ${state.private ? 'saved beside the motions' : state.graph}.` : '',
    running: 'The motions are being read and joined.',
    done: `${state.private ? 'The graph is built' : `Wrote ${state.graph}`}: ${text}.`,
    failed: `The graph is not built: ${text}`,
  };
  say('built', words[progress], progress === 'failed');
  $('stale').hidden = progress !== 'done' || !stale;
  $('run').hidden = state.private;
  say('command', `corybant run --graph "${state.graph}"`);
  if (!isBuilding && hasDance && (wasBuilding || !dance)) showDance();
  wasBuilding = isBuilding;
}

function noView(why) {
  stage = null;
  $('view').hidden = true;
  $('no-view').hidden = false;
  say('no-view', `The 3-D view does not work: ${why}. The graph is built.`);
}

async function showDance() {
  if (isTakingDance) return;
  isTakingDance = true;
  const isTaken = await attempt('no-view', async () => { dance = unpack(await server.dance()).dances[0] ?? null; });
  isTakingDance = false;
  if (!isTaken || !dance) return;
  $('dance').hidden = false;
  danceAt = performance.now();
  try {
    const { makeStage } = await import('../stage.js');
    stage ??= makeStage($('view'), noView);
    stage.setCast([{ ...dance.about, avatar: null }]);
  } catch (error) {
    console.warn(error);
    noView('this browser does not support WebGL 2, or WebGL 2 is switched off');
  }
}

function draw(now) {
  requestAnimationFrame(draw);
  for (const card of cards.values()) card.draw(now / 1000);
  if (!dance || !dance.times.length) return;
  const seconds = ((now - danceAt) / 1000) % dance.times.at(-1);
  const pose = poseAt(dance, Math.max(seconds, 0));
  say('now-label', pose.label ?? 'free');
  if (!stage) return;
  stage.setPoses([pose], seconds);
  const phase = pose.beat - Math.floor(pose.beat);
  stage.draw(now, still.matches ? 0.3 : (1 - phase) ** 2);
}

/** Adds the files `found`, each with the names of its folders. */
async function add(found) {
  const refused = [];
  isUploading = true;
  for (const [i, { file, folders }] of found.entries()) {
    say('added', `${i + 1} of ${found.length}: ${file.name}`);
    try {
      const next = await server.add(labelOf(file, folders), file);
      refused.push(...next.refused);
      take(next);
    } catch (error) {
      refused.push(error.message);
    }
  }
  isUploading = false;
  const count = found.length - refused.length;
  say('added', count > 0 ? `added ${count} of ${found.length}` : 'nothing added', count <= 0);
  showList($('refused'), refused);
}

$('files').addEventListener('change', () => {
  const found = [...$('files').files].map((file) => ({ file, folders: [] }));
  $('files').value = '';
  if (found.length) add(found);
});
addEventListener('dragover', (event) => {
  event.preventDefault();
  $('drop').dataset.over = true;
});
addEventListener('dragleave', (event) => {
  if (!event.relatedTarget) $('drop').dataset.over = false;
});
addEventListener('drop', async (event) => {
  event.preventDefault();
  $('drop').dataset.over = false;
  const found = await droppedFiles(event.dataTransfer);
  if (found.length) add(found);
});
$('build').addEventListener('click', () => attempt('built', async () => take(await server.build())));
$('save').addEventListener('click', () => attempt('saved', async () => {
  take(await server.save($('to').value, $('name').value));
  say('saved', `Saved in ${state.folder}.`);
}));
$('name').addEventListener('keydown', (event) => event.key === 'Enter' && $('save').click());
$('quit').addEventListener('click', () => attempt('saved', async () => {
  await server.quit();
  document.body.inert = true;
  say('saved', 'The import has ended. You can close this page.');
}));

requestAnimationFrame(draw);
attempt('notice', async () => take(await server.state()));
