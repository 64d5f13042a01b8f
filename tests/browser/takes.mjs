// Records takes on the page of a show, as its performer does: node takes.mjs URL [FOLDER_FOR_PICTURES]
//
// The show has a [[motion_in]] that receives a dancing show, 120 bpm, and no take yet. Prints a line for each promise; exits with status 0 if all are
// kept.

import { launch } from './chromium.mjs';
import { flawsOf } from './layout.mjs';
import { check, makePromises } from './promises.mjs';

const [url, pictures] = process.argv.slice(2);
const WAIT_MS = 60000;
const SIZES = { desktop: [1280, 720], phone: [390, 844] };

const browser = await launch();
const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
const page = await context.newPage();
page.setDefaultTimeout(WAIT_MS);
const { promise, end } = makePromises(page);

const record = page.locator('#record');
const button = (text) => record.getByRole('button', { name: text, exact: true });
const pad = (label) => page.locator(`.pad[data-label="${label}"]`);
const phase = (wanted) => page.waitForSelector(`#record [role="status"][data-phase="${wanted}"]`);
const takes = (text) => page.waitForFunction((wanted) => {
  const line = document.querySelector('#record [data-part="takes"]');
  return line.hidden ? wanted === '' : line.textContent === `Takes of this show: ${wanted}`;
}, text);

/** Opens the page and the part of the setup that records. */
async function open() {
  await page.goto(url);
  await page.waitForFunction(() => document.body.dataset.connection === 'live');
  await page.waitForSelector('.pad');
  await page.click('#open-setup');
  await page.click('[data-to="setup-record"]');
}

await open();

await promise('the setup shows the performer: who sends, how fast, how old the last pose is', async () => {
  const row = page.locator('#performers dd');
  await page.waitForFunction(() => /live, from 127\.0\.0\.1:\d+/.test(document.querySelector('#performers')?.textContent));
  const text = await row.allTextContents();
  check(text.length === 1 && /\d+ poses\/s, last pose \d+ ms ago/.test(text[0]), text.join());
  return text[0];
});

await promise('a take needs a label', async () => {
  await button('record').click();
  check((await record.getByRole('status').textContent()).includes('label'), 'nothing is said');
  check(await button('undo').count() === 0 && await button('rename').count() === 0, 'there is nothing to undo');
});

await promise('record counts in with at least four beats, and counts the beats of the take', async () => {
  await page.evaluate(() => {
    [window.counted, window.phases] = [[], []];
    const [count, said] = [document.querySelector('#count'), document.querySelector('#record [role="status"]')];
    const watch = (element, note) => new MutationObserver(note).observe(element, { childList: true, attributes: true });
    watch(count, () => { if (!count.hidden) window.counted.push(`${count.dataset.phase} ${count.textContent}`); });
    watch(said, () => window.phases.push(said.dataset.phase));
  });
  await record.getByLabel('Label of the take').fill('mine');
  await record.getByLabel('Length of the take').selectOption('16');
  await button('record').click();
  await button('stop').waitFor();
  if (pictures) {
    await phase('recording');
    await page.screenshot({ path: `${pictures}/takes-recording.png` });
  }
  await phase('kept');
  // A busy computer may show a phase too shortly to wait for it.
  const phases = await page.evaluate(() => [...new Set(window.phases)]);
  check(phases.join() === 'count_in,recording,building,kept', `phases: ${phases}`);
  const counted = await page.evaluate(() => [...new Set(window.counted)]);
  // The picture of a beat may be missed while the computer is busy.
  const before = counted.filter((text) => text.startsWith('count_in'));
  const during = counted.filter((text) => text.startsWith('recording ●'));
  check(before.length >= 2 && Number(before[0].split(' ')[1]) >= 3, `counted in: ${before}`);
  check(during.length >= 3, `counted: ${during}`);
  check(await page.locator('#count').isHidden(), 'the count stays');
  return counted.join(', ');
});

await promise('the take is a pad, and is danced when it is hit', async () => {
  await pad('mine').waitFor();
  await takes('mine');
  await pad('mine').click();
  await page.waitForFunction(() => document.querySelector('#now-label').textContent === 'mine');
  check((await record.getByRole('status').textContent()).startsWith('recorded "mine"'), 'the take is not described');
});

await promise('the take is renamed', async () => {
  await record.getByLabel('Label of the take').fill('yours');
  await button('rename').click();
  await pad('yours').waitFor();
  await takes('yours');
});

await promise('a pad records a take in the mode record', async () => {
  await page.getByRole('button', { name: 'Page 2 of the pads' }).click();
  await page.selectOption('#mode', 'record');
  await pad('yours').click();
  await takes('yours, yours');
  await page.selectOption('#mode', 'trigger');
});

await promise('both takes are undone, one after the other, though the page was loaded again', async () => {
  await open();
  await takes('yours, yours');
  await button('undo').click();
  await takes('yours');
  await open();
  await takes('yours');
  await button('undo').click();
  await takes('');
  check(await button('undo').count() === 0 && await button('rename').count() === 0, 'there is nothing to undo');
  check((await record.getByRole('status').textContent()).includes('takes/yours') || (await record.getByRole('status').textContent()).includes('takes/mine'), 'the motion file is not named');
});

await promise('follow me goes on with the motion that is most similar to the performer', async () => {
  // A dance without a cue has no number of beats left.
  const isCued = () => page.evaluate(() => document.querySelector('#now-clip').textContent.includes(' left'));
  while (await isCued()) await page.waitForTimeout(200);
  // The most similar pose may be in idle motion; then a later pose of the performer is in a dance.
  let found = false;
  for (let i = 0; i < 10 && !found; i++) {
    await button('follow me').click();
    for (let k = 0; k < 10 && !found; k++) {
      await page.waitForTimeout(200);
      found = await isCued();
    }
  }
  check(found, 'no cue is launched');
  return page.textContent('#now-label');
});

for (const [name, [width, height]] of Object.entries(SIZES)) {
  await promise(`the setup has a sound layout on a ${name}`, async () => {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(600);
    for (const to of ['setup-outputs', 'setup-record']) {
      await page.click(`[data-to="${to}"]`);
      if (pictures) await page.screenshot({ path: `${pictures}/takes-${to}-${name}.png` });
      // On a laptop the pads beside the drawer are low, and their figures small.
      const flaws = (await page.evaluate(flawsOf)).filter((flaw) => !flaw.startsWith('the figure of the pad'));
      check(flaws.length === 0, flaws.join('; '));
    }
  });
}

await browser.close();
end('takes');
