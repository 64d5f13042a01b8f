// Plays a set of three songs through by GO, on a phone: node set_list.mjs URL [FOLDER_FOR_PICTURES]
//
// The show has the songs "Opening" (salsa, disco), "The middle song" (zumba, twist; a motion graph of its own) and "Finale" (robot), at 150 bpm.
// Prints a line for each promise; exits with status 0 if all are kept.

import { readFileSync } from 'node:fs';

import { launch } from './chromium.mjs';
import { check, makePromises } from './promises.mjs';

const [url, pictures] = process.argv.slice(2);
const WAIT_MS = 60000;
const SIZES = { phone: [390, 844], desktop: [1280, 720], small: [320, 568] };
const SONGS = ['Opening', 'The middle song', 'Finale'];
const axe = readFileSync(new URL('node_modules/axe-core/axe.min.js', import.meta.url), 'utf8');

const browser = await launch();
const context = await browser.newContext({ viewport: { width: 390, height: 844 }, hasTouch: true });
const page = await context.newPage();
page.setDefaultTimeout(WAIT_MS);
const { promise, end } = makePromises(page);

const text = (id) => page.locator(`#${id}`).textContent();
const shows = (id, wanted) => page.waitForFunction(([id, wanted]) => document.getElementById(id).textContent === wanted, [id, wanted]);

/** The flaws of the layout at the present size, in words. */
function flaws() {
  const found = [];
  const inside = { right: innerWidth + 1, bottom: innerHeight + 1 };
  const seen = (id) => document.getElementById(id).getBoundingClientRect();
  // On a small phone the songs scroll into view.
  for (const id of ['title', 'position', 'go', 'back', 'hold', ...(innerHeight > 600 ? ['songs'] : [])]) {
    const { left, right, top, bottom } = seen(id);
    if (left < 0 || top < 0 || right > inside.right || bottom > inside.bottom) found.push(`${id} leaves the window`);
  }
  if (document.scrollingElement.scrollWidth > innerWidth) found.push('the page is wider than the window');
  const [go, back, hold] = ['go', 'back', 'hold'].map(seen);
  if (go.height < 110 || go.width < 0.4 * innerWidth) found.push(`GO has ${go.width} x ${go.height}`);
  for (const { height } of [back, hold]) if (height < 44) found.push('back or hold is too low');
  if (go.bottom > back.top) found.push('GO covers back');
  for (const id of ['go', 'back', 'hold']) {
    const element = document.getElementById(id);
    if (element.scrollWidth > element.clientWidth + 1 || element.scrollHeight > element.clientHeight + 1) found.push(`the text of ${id} is cut`);
  }
  for (const button of document.querySelectorAll('#songs button')) {
    if (button.getBoundingClientRect().height < 44) found.push('a song is too low');
    for (const part of button.children) if (part.scrollWidth > part.clientWidth + 1) found.push(`${part.textContent} is cut`);
  }
  return found;
}

/** Checks the layout at all sizes, and takes pictures named `name`. */
async function look(name) {
  for (const [size, [width, height]] of Object.entries(SIZES)) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(100);
    if (pictures) await page.screenshot({ path: `${pictures}/${name}-${size}.png` });
    const found = await page.evaluate(flaws);
    check(found.length === 0, `${size}: ${found.join('; ')}`);
  }
  await page.setViewportSize({ width: 390, height: 844 });
}

/** Waits until the label `label` is danced. */
const danced = (label) => page.waitForFunction((label) => window.danced?.includes(label), label);

await page.addInitScript(() => {
  window.danced = [];
  addEventListener('DOMContentLoaded', () => {
    const label = document.querySelector('#label');
    if (!label) return;
    new MutationObserver(() => window.danced.push(label.textContent)).observe(label, { childList: true });
  });
});
await page.goto(url);

await promise('the page shows the songs, and that GO starts the first one', async () => {
  await page.waitForFunction(() => document.body.dataset.connection === 'live');
  check((await page.locator('#songs .name').allTextContents()).join() === SONGS.join(), 'other songs');
  await shows('next', SONGS[0]);
  await shows('position', 'GO starts the first song');
  check(await page.locator('#hold').isDisabled() && await page.locator('#back').isDisabled(), 'there is nothing to hold');
  await look('start');
});

for (const [i, [song, ...wanted]] of [[SONGS[0], 'salsa', 'disco'], [SONGS[1], 'zumba', 'twist'], [SONGS[2], 'robot']].entries()) {
  await promise(`GO starts ${song}, and its labels are danced: ${wanted.join(', ')}`, async () => {
    await page.waitForFunction(() => document.querySelector('#next-state').textContent === '');
    await page.evaluate(() => { window.danced = []; });
    await page.locator('#go').tap();
    await shows('title', song);
    for (const label of wanted) await danced(label);
    check((await page.locator('#songs [data-state="current"] .name').textContent()) === song, 'another song is marked');
    if (SONGS[i + 1]) await shows('next', SONGS[i + 1]);
    const position = await text('position');
    check(/^bar \d+ · beat [1-4]$/.test(position), position);
    if (i === 0) await look('playing');
    return position;
  });
}

await promise('after the last song there is no GO', async () => {
  await shows('next', 'end of the set');
  check(await page.locator('#go').isDisabled(), 'GO is enabled');
  await look('end');
});

await promise('hold stops the position, and lets it go on', async () => {
  await page.locator('#hold').tap();
  await page.waitForSelector('#hold[aria-pressed="true"]');
  await page.waitForFunction(() => document.querySelector('#position').textContent.startsWith('held · bar'));
  const held = await text('position');
  await page.waitForTimeout(1000);
  check(await text('position') === held, 'the position moves');
  await look('held');
  await page.keyboard.press('h');
  await page.waitForSelector('#hold[aria-pressed="false"]');
  return held;
});

await promise('back waits for the bar and can be dropped; keys work', async () => {
  await page.keyboard.press('b');
  await shows('title', SONGS[1]);
  await page.waitForTimeout(700);
  await page.keyboard.press('Space');
  await shows('title', SONGS[2]);
});

await promise('a jump needs two taps', async () => {
  const first = page.locator('#songs button').first();
  await first.tap();
  await page.waitForSelector('#songs li[data-armed="true"]');
  await look('armed');
  check(await text('title') === SONGS[2], 'one tap was enough');
  await page.locator('#songs li[data-armed="true"] button').tap();
  await shows('title', SONGS[0]);
});

await promise('the page keeps the rules of accessibility', async () => {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => window.axe.run());
  check(violations.length === 0, violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`).join('; '));
});

await promise('the page of the show links to the set list', async () => {
  await page.goto(new URL('/', url).href);
  await page.locator('#open-set').click();
  await page.waitForURL('**/set');
});

await browser.close();
end('set_list');
