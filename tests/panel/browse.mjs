// Looks at the panel with a real browser, and drives it: see tests/panel.rs.
//
// Arguments: the browser, the address of a panel, the folder for pictures. Lines on standard input answer what it asks for by lines on
// standard output: "kill" (end the panel), "start" (start it again at the same address).
import { createInterface } from 'node:readline';
import assert from 'node:assert/strict';
import { browse } from './browser.mjs';

const [executablePath, url] = process.argv.slice(2);
const answers = createInterface({ input: process.stdin })[Symbol.asyncIterator]();
const ask = async (what) => { console.log(what); await answers.next(); };

await browse(executablePath, async ({ open, holds, text, shot, passed, serious }) => {
  const state = (page, wanted) => holds(page, (wanted) => document.querySelector('#state').textContent === wanted, wanted);
  const separation = (page) => page.evaluate(() => Number(/now (-?[\d.]+)/.exec(document.querySelectorAll('#axes .now')[1].textContent)[1]));
  const mode = (page, name) => holds(page, (name) => document.querySelector('#modes [aria-pressed="true"]')?.textContent === name, name);
  const drives = (page) => holds(page, () => document.querySelector('#who').textContent.startsWith('you drive'));
  // A browser beside much other work may be silent for so long that its page drives no longer: it asks again.
  const keeps = async (page) => {
    if (!(await text(page, '#who')).startsWith('you drive')) await page.click('#take');
    await drives(page);
  };
  // Numbers of pixels of the cloud's canvas that are neither ground nor grid.
  const coloured = (page) => page.evaluate(() => {
    const canvas = document.querySelector('#cloud');
    const flat = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d');
    flat.drawImage(canvas, 0, 0);
    const { data } = flat.getImageData(0, 0, canvas.width, canvas.height);
    const counts = new Map();
    for (let i = 0; i < data.length; i += 4) {
      const colour = (data[i] << 16) | (data[i + 1] << 8) | data[i + 2];
      counts.set(colour, (counts.get(colour) ?? 0) + 1);
    }
    return counts.size;
  });

  const first = await open(url, { viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  // The rig homes by itself, and is then measured.
  await holds(first, () => /points of/.test(document.querySelector('#cloud-chip').textContent));
  passed('a cloud is there');
  await first.click('#take');
  await drives(first);

  await first.click('#modes button:has-text("human")');
  await mode(first, 'human');
  await state(first, 'idle');
  const human = await text(first, '#zones');
  assert.ok(Math.abs(await separation(first)) < 0.5, 'parallel axes');
  passed('human');

  await first.click('#modes button:has-text("herbivore")');
  await mode(first, 'herbivore');
  await state(first, 'idle');
  await holds(first, (before) => document.querySelector('#zones').textContent !== before, human);
  assert.ok(Math.abs(await separation(first) - 120) < 0.5, 'herbivore looks aside');
  passed(`herbivore: ${await text(first, '#zones')}`);

  // The points of the cloud are drawn, and one of them tells why it is trusted.
  await holds(first, () => /[1-9]\d* points of/.test(document.querySelector('#cloud-chip').textContent));
  await first.focus('#cloud');
  for (let tries = 0; await coloured(first) < 30; tries += 1) {
    assert.ok(tries < 50, 'no point is drawn');
    await first.waitForTimeout(200);
  }
  // A picked point may be gone in the next cloud.
  for (let tries = 0; !await first.isVisible('#point h3'); tries += 1) {
    assert.ok(tries < 20, 'no point is picked');
    await first.keyboard.press('n');
    await first.waitForTimeout(50);
  }
  assert.match(await text(first, '#point h3'), /^\d+\.\d ± [\d.]+ mm$/);
  await shot(first, 'desktop');
  passed(`a point at ${await text(first, '#point h3')}`);

  // A plan moves nothing.
  await first.click('#plan summary');
  await holds(first, () => /sees \d+/.test(document.querySelector('#plan-answer').textContent));
  passed(await text(first, '#plan-answer'));

  // The space bar stops in mid-move, whatever has the focus.
  await first.click('#modes button:has-text("human")');
  await holds(first, () => Number(/now (-?[\d.]+)/.exec(document.querySelectorAll('#axes .now')[1].textContent)[1]) < 100);
  await first.focus('#home');
  await first.keyboard.press('Space');
  await state(first, 'idle');
  const stopped = await separation(first);
  assert.ok(stopped > 1 && stopped < 110, `it stopped at ${stopped} degrees`);
  passed(`stopped at ${stopped} degrees`);

  // A second page, a phone, watches, asks, and takes over.
  const second = await open(url, { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: 'light' });
  await keeps(first);
  await holds(second, () => /page \d+ drives, you watch/.test(document.querySelector('#who').textContent));
  await holds(second, () => document.querySelector('#home').disabled); // Who watches does not drive.
  assert.ok(await second.isEnabled('#stop'), 'everybody may stop');
  await second.click('#take');
  await first.click('#take:has-text("Hand over")');
  await drives(second);
  await holds(first, () => document.querySelector('#home').disabled);
  await holds(second, () => !document.querySelector('#cloud-chip').textContent.startsWith('no cloud'));
  const wide = await second.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `the page is ${wide} pixels wide on a phone of 390`);
  const stop = await second.locator('#stop').boundingBox();
  assert.ok(stop.y + stop.height <= 844 && stop.height >= 44, 'the stop is in reach');
  await shot(second, 'phone', true);
  passed('a phone took over');

  // Nobody finds a serious fault of accessibility, in either colour scheme.
  for (const [page, name] of [[first, 'dark'], [second, 'light']]) {
    assert.deepEqual(await serious(page), [], name);
  }
  passed('axe finds nothing serious');

  // The panel ends and comes back; the page finds it again by itself.
  await ask('kill');
  await holds(first, () => !document.querySelector('#banner').hidden && /does not answer/.test(document.querySelector('#banner').textContent));
  await ask('start');
  await holds(first, () => document.querySelector('#banner').hidden && document.querySelector('#who').textContent.startsWith('nobody drives'));
  await first.emulateMedia({ colorScheme: 'light' });
  await holds(first, () => /points of/.test(document.querySelector('#cloud-chip').textContent));
  await shot(first, 'light');
  passed('the panel came back');
});
