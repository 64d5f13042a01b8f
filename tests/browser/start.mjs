// Sets up a show on the page of `corybant` without a command, as a user does:
// node start.mjs LINK FOLDER_OF_MOTIONS RENDERER_PORT FOLDER_TO_SAVE [FOLDER_FOR_SCREENSHOTS]
//
// The computer plays music on its default output "room"; its other output "hall" is silent. Prints a line for each promise; exits with status 0 if
// all are kept.

import { readFileSync } from 'node:fs';

import { launch } from './chromium.mjs';
import { check, makePromises } from './promises.mjs';

const [link, motions, port, folder, shots] = process.argv.slice(2);
const WAIT_MS = 40000;
const SIZES = { desktop: [1440, 900], tablet: [820, 1180], phone: [390, 844], 'phone-side': [844, 390] };
const started = Date.now();

const browser = await launch();
const context = await browser.newContext({ viewport: { width: 1440, height: 900 } });
const page = await context.newPage();
page.setDefaultTimeout(WAIT_MS);
let isRefusalExpected = false;
// While the show starts again, and for a refused request, the browser logs the failure.
const isExpected = (text) => /ERR_CONNECTION|WebSocket/.test(text) || (isRefusalExpected && /status of 4(09|22)/.test(text));
const { promise, end } = makePromises(page, isExpected);
const part = (name) => page.locator(`#setup [data-part="${name}"]`);
const saying = (name, text) => page.waitForFunction(([wanted, words]) => document.querySelector(`#setup [data-part="${wanted}"]`).textContent.includes(words), [name, text]);
const levelAbove = (db) => page.waitForFunction((least) => Number(document.querySelector('#setup [data-part="level"]').getAttribute('aria-valuenow')) > least, db);
const silent = () => page.waitForFunction(() => document.querySelector('#setup [data-part="level"] .value').textContent === 'silent');
const post = (path, body) => page.evaluate(async ([to, json]) => {
  const response = await fetch(`/setup/${to}`, { method: 'POST', body: JSON.stringify(json) });
  return { status: response.status, json: await response.json() };
}, [path, body]);

await page.goto(link);

await promise('the link opens the page, and the address bar does not keep the code', async () => {
  await page.waitForSelector('#setup:not([hidden])');
  check(new URL(page.url()).search === '', page.url());
});

await promise('without a click the dancer dances to what the computer plays', async () => {
  await levelAbove(-50);
  await page.waitForFunction(() => document.querySelector('#music').dataset.on === 'true' && !/^idle$/.test(document.querySelector('#now-label').textContent));
  const pose = await page.evaluate(() => document.body.dataset.pose);
  await page.waitForFunction((was) => document.body.dataset.pose !== was, pose);
  await saying('sound', 'hears sound');
  return `${((Date.now() - started) / 1000).toFixed(1)} s from the browser's start, as it draws in software`;
});

await promise('the list of inputs marks what the computer plays, and an input is chosen live', async () => {
  const texts = await part('input').locator('optgroup[label="What the computer plays"] option').allTextContents();
  check(texts.length >= 3 && texts.every((text) => text.startsWith('\u266A')), texts.join());
  check(await part('input').inputValue() === 'output', await part('input').inputValue());
  await part('input').selectOption('output:hall');
  await silent();
  await part('refresh').click();
  await saying('sound', 'inputs found');
  await part('input').selectOption('output:room');
  await levelAbove(-50);
});

await promise('an input that does not open is refused, and the one before goes on', async () => {
  isRefusalExpected = true;
  const { status, json } = await post('input', { input: 'Line 77' });
  check(status === 422 && json.message.includes('Line 77'), JSON.stringify(json));
  await page.waitForTimeout(500);
  await levelAbove(-50);
  await page.reload();
  await page.waitForFunction(() => document.querySelector('#setup [data-part="input"]').value === 'output:room');
});

await promise('a renderer gets the poses at the address that is written', async () => {
  await part('renderer').selectOption('warudo');
  check((await part('to').inputValue()) === '127.0.0.1:39539', await part('to').inputValue());
  await saying('hint', 'Setup Motion Capture');
  if (shots) {
    await part('folder').fill('/home/me/Documents/Corybant');
    await page.screenshot({ path: `${shots}/setup.png` });
  }
  await part('to').fill('127.0.0.1');
  await part('send').click();
  await saying('sent', 'must be HOST:PORT');
  await part('to').fill(`127.0.0.1:${port}`);
  await part('to').press('Enter');
  await saying('sent', `127.0.0.1:${port} (vmc)`);
  await saying('hint', `receiver to ${port}`);
});

await promise('keys in a text field hit no pad, and every control can be reached by keyboard', async () => {
  await part('name').fill('');
  await part('name').pressSequentially('a1e');
  // Freestyle may dance a label, but only a hit queues one.
  check(await page.locator('.pad[data-state="queued"]').count() === 0, 'a key in a text field hit a pad');
  await part('close').focus();
  const reached = new Set();
  for (let i = 0; i < 34; i++) {
    reached.add(await page.evaluate(() => document.activeElement.dataset.part));
    await page.keyboard.press('Tab');
  }
  const wanted = ['close', 'input', 'refresh', 'renderer', 'to', 'send', 'files', 'label', 'import', 'folder', 'name', 'save', 'open', 'quit'];
  const missing = wanted.filter((name) => !reached.has(name));
  check(missing.length === 0, `not reached by Tab: ${missing}`);
  await part('close').focus();
  await page.keyboard.press('Enter');
  check(await page.locator('#setup').isHidden() && await page.evaluate(() => document.activeElement.id) === 'open-setup', 'the setup is not closed');
  await page.keyboard.press('Enter');
  await page.waitForSelector('#setup:not([hidden])');
});

await promise('the files of dropped folders get the names of their folders as labels', async () => {
  const labels = await page.evaluate(async () => {
    const { droppedFiles, labelOf } = await import('/upload.js');
    const file = (name) => ({ isFile: true, name, file: (done) => done(new File(['x'], name)) });
    // As a browser does, a reader gives the entries in parts and ends with an empty part.
    const folder = (name, ...entries) => ({
      isDirectory: true,
      name,
      createReader() {
        const parts = [entries.slice(0, 1), entries.slice(1), []].filter((part, i) => part.length || i === 2);
        return { readEntries: (done) => done(parts.shift()) };
      },
    });
    const dropped = [
      folder('MOTIONS', folder('hip hop', file('a.bvh'), file('.hidden')), folder('salsa 2', folder('deep', file('b.glb')), file('c.bvh'))),
      folder('twist', file('d.bvh')),
      file('jump_03.vrma'),
      file('12.bvh'),
    ];
    const found = await droppedFiles({ items: dropped.map((entry) => ({ webkitGetAsEntry: () => entry })), files: [] });
    return found.map(({ file: { name }, folders }) => `${name}: ${labelOf({ name }, folders)}`);
  });
  const wanted = ['a.bvh: hip hop', 'b.glb: salsa', 'c.bvh: salsa', 'd.bvh: twist', 'jump_03.vrma: jump', '12.bvh: dance'];
  check(labels.join() === wanted.join(), labels.join());
});

await promise('dropped and chosen motions are built; a broken file is named', async () => {
  await page.evaluate(([good, broken]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([good], 'salsa_01.bvh'));
    transfer.items.add(new File([broken], 'broken.bvh'));
    transfer.items.add(new File(['x'], 'notes.txt'));
    document.querySelector('#setup [data-part="drop"]').dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true }));
  }, [readFileSync(`${motions}/salsa.bvh`, 'utf8'), 'HIERARCHY\n']);
  isRefusalExpected = true;
  await saying('problem', 'notes.txt');
  await saying('built', 'The dancer dances your motions');
  await page.waitForFunction(() => [...document.querySelectorAll('.pad')].map((pad) => pad.dataset.label).join() === 'salsa');
  await part('label').fill('my twist');
  await part('files').setInputFiles(`${motions}/twist.bvh`);
  await page.waitForFunction(() => [...document.querySelectorAll('.pad')].map((pad) => pad.dataset.label).join() === 'my twist,salsa');
  await saying('built', '2 labels: my twist, salsa');
  check(await part('label').inputValue() === '', 'the label stays for the next files');
  const broken = await part('list').locator('li[data-wrong="true"]').allTextContents();
  check(broken.length === 1 && broken[0].startsWith('broken/broken.bvh: '), broken.join());
  return broken[0];
});

await promise('the import page gives a dropped motion another label, and the show dances the changes', async () => {
  check(await part('rebuild').isHidden(), 'there are no changes yet');
  const [tab] = await Promise.all([context.waitForEvent('page'), part('import').click()]);
  tab.setDefaultTimeout(WAIT_MS);
  const field = tab.locator('.clip[data-file="salsa/salsa_01.bvh"] [name="label"]');
  await field.fill('slow salsa');
  await field.press('Tab');
  await tab.waitForFunction(async () => {
    const { files } = await (await fetch('/setup/import/state')).json();
    return files.some(({ file, label }) => file === 'salsa/salsa_01.bvh' && label === 'slow salsa');
  });
  check(new URL(tab.url()).port !== new URL(page.url()).port && new URL(tab.url()).search === '', tab.url());
  if (shots) await tab.screenshot({ path: `${shots}/setup-import.png` });
  await tab.close();
  await part('rebuild').click();
  await saying('built', '2 labels: my twist, slow salsa');
  await page.waitForFunction(() => [...document.querySelectorAll('.pad')].map((pad) => pad.dataset.label).join() === 'my twist,slow salsa');
});

await promise('a pad starts its label', async () => {
  await page.locator('.pad[data-label="my twist"]').click();
  await page.waitForFunction(() => document.querySelector('#now-label').textContent === 'my twist');
  await page.keyboard.press('Escape');
});

for (const [name, [width, height]] of Object.entries(SIZES)) {
  await promise(`on a ${name} the setup fits and is accessible (WCAG 2.1 AA, by axe)`, async () => {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(600);
    const wide = await page.evaluate(() => [...document.querySelectorAll('#setup *')].filter((element) => {
      const [box, panel] = [element.getBoundingClientRect(), document.querySelector('#setup').getBoundingClientRect()];
      return box.width > 1 && box.right > panel.right + 1;
    }).map((element) => element.dataset.part ?? element.tagName));
    check(wide.length === 0, `wider than the setup: ${wide}`);
    const stage = await page.locator('#view').boundingBox();
    check(stage.width > 200 && stage.height > 200, `the dancer has ${stage.width} x ${stage.height} pixels`);
    await page.evaluate(readFileSync(new URL('node_modules/axe-core/axe.min.js', import.meta.url), 'utf8'));
    const { violations } = await page.evaluate(() => axe.run({ runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'best-practice'] }));
    check(violations.length === 0, violations.map(({ id, nodes }) => `${id} at ${nodes.map(({ target }) => target).join(', ')}`).join('; '));
    if (shots) await page.screenshot({ path: `${shots}/setup-${name}.png` });
    if (width < 1100) {
      await part('pads').click();
      check(await page.locator('.pad').first().isVisible(), 'no pad is visible');
      await page.click('#open-setup');
      await page.waitForSelector('#setup:not([hidden])');
    }
  });
}
await page.setViewportSize({ width: 1440, height: 900 });

await promise('the show is saved, and a file is replaced only on request', async () => {
  isRefusalExpected = true;
  await part('folder').fill('shows');
  await part('name').fill('club');
  await part('save').click();
  await saying('saved', 'not a full path');
  await part('folder').fill(folder);
  await part('save').click();
  await saying('saved', 'club.toml');
  await part('save').click();
  await saying('saved', 'exists already');
  await part('replace').click();
  await saying('saved', 'Saved.');
});

await promise('the built-in motions come back, and a saved show can be opened', async () => {
  await part('remove').click();
  await page.waitForFunction(() => document.querySelectorAll('.pad').length > 10);
  await page.waitForFunction(() => document.body.dataset.connection === 'live');
  await part('open').click();
  await page.waitForFunction(() => document.querySelectorAll('.pad').length === 2);
  await saying('sent', `127.0.0.1:${port} (vmc)`);
});

await promise('the show can be ended on the page', async () => {
  await part('quit').click();
  await saying('problem', 'The show has ended');
});

await browser.close();
end('start');
