// Imports motions on the page of `corybant import`, as a user does: node import.mjs LINK FOLDER_OF_FILES FOLDER_TO_SAVE [FOLDER_FOR_PICTURES]
//
// The page starts empty. The folder of files has salsa_01.bvh, twist.glb and jump.vrma, each with a skeleton of its own, broken.bvh, and clips.zip
// with wave_1.bvh. Prints a line for each promise; exits with status 0 if all are kept. The variable CORYBANT_ASSETS names a folder whose files
// replace those of the program, for work on the page without a build.

import { existsSync, readFileSync } from 'node:fs';

import { launch } from './chromium.mjs';
import { check, makePromises } from './promises.mjs';

const [link, files, folder, pictures] = process.argv.slice(2);
const WAIT_MS = 60000;
const SIZES = { desktop: [1280, 720], phone: [390, 844], tablet: [820, 1180], large: [3840, 2160], small: [320, 640] };
const axe = readFileSync(new URL('node_modules/axe-core/axe.min.js', import.meta.url), 'utf8');

const browser = await launch();
const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
const page = await context.newPage();
page.setDefaultTimeout(WAIT_MS);
// The browser logs each refused request.
const { promise, end } = makePromises(page, (text) => /status of 422/.test(text));
const assets = process.env.CORYBANT_ASSETS;
await page.route((to) => to.origin === new URL(link).origin, (route) => {
  const path = new URL(route.request().url()).pathname;
  const file = assets && `${assets}${path === '/' ? '/import/index.html' : path}`;
  const isAsset = file && existsSync(file) && !route.request().url().includes('?');
  return isAsset ? route.fulfill({ path: file }) : route.continue();
});

const saying = (id, text) => page.waitForFunction(([wanted, words]) => document.getElementById(wanted).textContent.includes(words), [id, text]);
const clip = (path) => page.locator(`.clip[data-file="${path}"]`);
const state = () => page.evaluate(async () => (await fetch('/setup/import/state')).json());
const isQuiet = async () => {
  await page.waitForFunction(async () => !(await (await fetch('/setup/import/state')).json()).busy);
};
const picture = (name) => pictures && page.screenshot({ path: `${pictures}/import-${name}.png` });

/** Drops the files `names` onto the page. */
const drop = (...names) => page.evaluate((found) => {
  const transfer = new DataTransfer();
  for (const [name, text] of found) transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
  document.querySelector('#drop').dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true }));
}, names.map((name) => [name, existsSync(`${files}/${name}`) ? readFileSync(`${files}/${name}`).toString('base64') : btoa('x')]));

/** Changes the field `name` of the clip `path`, and waits until the program has the value `value`. */
async function set(path, name, value) {
  const field = clip(path).locator(`[name="${name}"]`);
  if (typeof value === 'boolean') await field.setChecked(value);
  else {
    await field.fill(value);
    await field.press('Tab');
  }
  const wanted = typeof value === 'string' && name.endsWith('_s') ? Number(value) : value;
  await page.waitForFunction(async ([file, key, to]) => {
    const { files: all } = await (await fetch('/setup/import/state')).json();
    return all.find((one) => one.file === file)[key] === to;
  }, [path, name, wanted]);
}

await promise('the link opens the page, and the address bar does not keep the code', async () => {
  await page.goto(link);
  await saying('folder', 'not saved yet');
  check(new URL(page.url()).search === '', page.url());
  check(await page.locator('#build').isDisabled(), 'there is nothing to build');
  await picture('empty');
});

await promise('three files of three skeletons become moving figures with their beats; a broken file and another file are named', async () => {
  await drop('salsa_01.bvh', 'twist.glb', 'jump.vrma', 'broken.bvh', 'notes.txt');
  await saying('refused', 'notes.txt');
  // The files are received one after another.
  await page.waitForFunction(() => [...document.querySelectorAll('.clip .about')].filter((about) => about.textContent.includes(' beats, ')).length === 3);
  await page.waitForFunction(() => document.querySelectorAll('.clip .thumb').length === 3);
  await isQuiet();
  const about = await page.locator('.clip .about').allTextContents();
  const used = about.filter((text) => /\d+ beats, \d+ bpm · rest pose \d\.\d\d m, in \w+, [+-][XYZ] up/.test(text));
  check(used.length === 3, about.join(' | '));
  await page.waitForFunction(() => document.querySelector('.clip[data-file="broken/broken.bvh"] .problem').textContent.startsWith('line 2: '));
  const pixels = () => page.evaluate(() => [...document.querySelectorAll('.clip .thumb')].map((canvas) => canvas.toDataURL()).join());
  const before = await pixels();
  await page.waitForFunction((was) => [...document.querySelectorAll('.clip .thumb')].map((canvas) => canvas.toDataURL()).join() !== was, before);
  return used.join(' | ');
});

await promise('the motions of a ZIP are added by keyboard and file choice', async () => {
  await page.locator('#files').setInputFiles(`${files}/clips.zip`);
  await clip('wave/wave_1.bvh').waitFor();
  await isQuiet();
});

await promise('labels, a trim and marks are saved, and a wrong trim is refused with the reason', async () => {
  await set('salsa/salsa_01.bvh', 'label', 'slow salsa');
  await set('salsa/salsa_01.bvh', 'start_s', '0.5');
  await set('jump/jump.vrma', 'mirror', false);
  await set('twist/twist.glb', 'on_request', true);
  check(await clip('twist/twist.glb').locator('[name="idle"]').isDisabled(), 'idle and on request exclude each other');
  await set('wave/wave_1.bvh', 'label', '');
  await set('wave/wave_1.bvh', 'idle', true);
  const end = clip('salsa/salsa_01.bvh').locator('[name="end_s"]');
  await end.fill('0.2');
  await end.press('Tab');
  await page.waitForFunction(() => document.querySelector('.clip[data-file="salsa/salsa_01.bvh"] [role="status"]').textContent.includes('end_s is 0.2'));
  await end.fill('');
  await end.press('Tab');
  await page.waitForFunction(() => document.querySelector('.clip[data-file="salsa/salsa_01.bvh"] [role="status"]').textContent === '');
  const { files: all } = await state();
  check(all.find(({ file }) => file.startsWith('salsa/')).end_s === null, 'the wrong trim is saved');
});

await promise('an added file is removed', async () => {
  await clip('broken/broken.bvh').locator('.remove').click();
  await page.waitForFunction(() => document.querySelectorAll('.clip').length === 4);
  check(await page.evaluate(() => document.activeElement.id) === 'files', 'the focus is lost');
  await isQuiet();
});

await promise('the graph is built, and its dance shows each label', async () => {
  await isQuiet();
  await page.click('#build');
  await saying('built', '3 labels');
  await saying('built', 'slow salsa');
  await page.waitForFunction(() => document.body.dataset.pose && document.querySelector('#now-label').textContent !== '–');
  const pose = await page.evaluate(() => document.body.dataset.pose);
  await page.waitForFunction((was) => document.body.dataset.pose !== was, pose);
  const seen = new Set();
  for (const label of ['slow salsa', 'twist', 'jump']) {
    await page.waitForFunction((wanted) => document.querySelector('#now-label').textContent === wanted, label);
    seen.add(label);
  }
  return [...seen].join(', ');
});

for (const [name, [width, height]] of Object.entries(SIZES)) {
  await promise(`at ${width} × ${height} nothing overlaps, and the page is accessible (WCAG 2.1 AA, by axe)`, async () => {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(500);
    await picture(name);
    const flaws = await page.evaluate(() => {
      const found = [];
      const shown = (selector) => [...document.querySelectorAll(selector)].filter((element) => element.checkVisibility());
      const box = (element) => element.getBoundingClientRect();
      const what = (element) => `${element.tagName} ${element.id || element.name || element.className} "${element.textContent.slice(0, 30)}"`;
      if (document.documentElement.scrollWidth > innerWidth + 1) found.push(`the page is ${document.documentElement.scrollWidth} pixels wide`);
      for (const element of shown('main, aside')) if (element.scrollWidth > element.clientWidth + 1) found.push(`${what(element)} is too narrow`);
      for (const element of shown('main *, aside *')) {
        if (box(element).width > 1 && (box(element).right > innerWidth + 1 || box(element).left < -1)) found.push(`${what(element)} is outside`);
      }
      const parts = shown('.clip :is(h3, .about, .problem, .warnings, details, .figure, .settings label), aside > *, main > *, .clip');
      parts.forEach((a, i) => parts.slice(i + 1).forEach((b) => {
        if (a.contains(b) || b.contains(a)) return;
        const [one, two] = [box(a), box(b)];
        const wide = Math.min(one.right, two.right) - Math.max(one.left, two.left);
        const tall = Math.min(one.bottom, two.bottom) - Math.max(one.top, two.top);
        if (wide > 1 && tall > 1 && a.closest('main, aside') === b.closest('main, aside')) found.push(`${what(a)} and ${what(b)} overlap`);
      }));
      for (const element of shown('button, .button, input:not([type="file"])')) {
        if (element.type === 'number' && box(element).width < 80) found.push(`the text of ${what(element)} is cut`);
        if (box(element).width < 20 || box(element).height < 20) found.push(`${what(element)} is too small to hit`);
      }
      return found;
    });
    check(flaws.length === 0, flaws.slice(0, 3).join('; '));
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => axe.run({ runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'best-practice'] }));
    check(violations.length === 0, violations.map(({ id, nodes }) => `${id} at ${nodes.map(({ target }) => target).join(', ')}`).join('; '));
    if (pictures && width < 900) await page.screenshot({ path: `${pictures}/import-${name}-whole.png`, fullPage: true });
  });
}
await page.setViewportSize({ width: 1280, height: 720 });

await promise('the motions are saved with their graph in a folder of the user', async () => {
  await page.fill('#to', 'relative');
  await page.click('#save');
  await saying('saved', 'not a full path');
  await page.fill('#to', folder);
  await page.fill('#name', 'club');
  await page.click('#save');
  await saying('saved', 'Saved in');
  await saying('command', 'club.graph');
  check(await page.locator('#keep').isHidden(), 'there is nothing left to save');
});

await promise('the page can be reloaded, and a changed label asks for a new build', async () => {
  await page.reload();
  await saying('folder', 'club');
  await page.waitForFunction(() => document.querySelectorAll('.clip').length === 4);
  await set('jump/jump.vrma', 'label', 'leap');
  await page.waitForFunction(() => !document.querySelector('#stale').hidden);
  await page.click('#build');
  await saying('built', 'leap');
  await page.waitForFunction(() => document.querySelector('#stale').hidden);
});

await promise('the page can be closed', async () => {
  await page.click('#quit');
  await saying('saved', 'The import has ended');
});

await browser.close();
end('import');
