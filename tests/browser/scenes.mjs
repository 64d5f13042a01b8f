// Recalls scenes on the page of a show, as its performer does: node scenes.mjs URL [FOLDER_FOR_PICTURES]
//
// The show has the scenes `Calm` (waits for four bars) and `solo` (next beat), and none is on. Prints a line for each promise; exits with status 0 if
// all are kept.

import { launch } from './chromium.mjs';
import { flawsOf } from './layout.mjs';
import { check, makePromises } from './promises.mjs';

const [url, pictures] = process.argv.slice(2);
const SIZES = { desktop: [1280, 720], phone: [390, 844] };

const browser = await launch();
const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
const page = await context.newPage();
page.setDefaultTimeout(60000);
const { promise, end } = makePromises(page);

const scene = (name) => page.locator(`#scenes [data-scene="${name}"]`);
const shows = (name, state) => page.waitForSelector(`#scenes [data-scene="${name}"][data-state="${state}"]`);

await page.goto(url);
await page.waitForFunction(() => document.body.dataset.connection === 'live');
await page.waitForSelector('.pad');

await promise('each scene has a button, and none is on', async () => {
  const texts = await page.locator('#scenes button').allTextContents();
  check(texts.join() === 'Calm,solo,×', texts.join());
  check(await page.locator('#scenes button').last().isDisabled(), 'there is something to end');
  await shows('Calm', 'idle');
});

await promise('a scene waits for its bars and begins', async () => {
  // A busy computer may show a state too shortly to wait for it.
  await page.evaluate(() => {
    window.states = [];
    const button = document.querySelector('#scenes [data-scene="Calm"]');
    new MutationObserver(() => window.states.push(button.dataset.state)).observe(button, { attributes: true });
  });
  await scene('Calm').click();
  await shows('Calm', 'on');
  const states = await page.evaluate(() => [...new Set(window.states)]);
  check(states.includes('on') && states.every((state) => ['queued', 'on', 'idle'].includes(state)), states.join());
  check(await scene('Calm').getAttribute('aria-pressed') === 'true', 'it is not pressed');
});

await promise('another scene takes its place, by the keyboard', async () => {
  await scene('solo').focus();
  await page.keyboard.press('Enter');
  await shows('solo', 'on');
  await shows('Calm', 'idle');
});

for (const [name, [width, height]] of Object.entries(SIZES)) {
  await promise(`the scenes fit on a ${name}`, async () => {
    await page.setViewportSize({ width, height });
    const flaws = await page.evaluate(flawsOf);
    check(flaws.length === 0, flaws.join('; '));
    if (pictures) await page.screenshot({ path: `${pictures}/scenes-${name}.png` });
  });
}

await promise('the scene ends', async () => {
  await page.locator('#scenes button').last().click();
  await shows('solo', 'idle');
});

await promise('the setup learns a scene', async () => {
  const options = await page.locator('#learn select').first().locator('option').evaluateAll((all) => all.map((it) => it.value));
  check(options.includes('!scene Calm') && options.includes('!scene_end'), options.join());
});

await browser.close();
end('scenes');
