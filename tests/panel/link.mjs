// Watches with a real browser how the panel goes on without the link to its board, and finds it again: see tests/panel.rs.
//
// Arguments: the browser, the address of the panel, the folder for pictures.
import assert from 'node:assert/strict';
import { browse } from './browser.mjs';

const [executablePath, url] = process.argv.slice(2);
await browse(executablePath, async ({ open, holds, text, shot, passed, serious }) => {
  const page = await open(url, { viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  await holds(page, () => /points of/.test(document.querySelector('#cloud-chip').textContent));
  await page.click('#take');
  await holds(page, () => document.querySelector('#who').textContent.startsWith('you drive'));
  passed('a cloud with a link');

  // The page stays: for how long there has been no link, and how uncertain the last pose has become since.
  await holds(page, () => document.querySelector('#state').textContent === 'no link');
  const gone = async () => Number(/link lost for (\d+) s/.exec(await text(page, '#link-chip'))[1]);
  const sigma = async () => Number(/last pose ±([\d.]+) mm/.exec(await text(page, '#link-chip'))[1]);
  const [since, uncertain] = [await gone(), await sigma()];
  assert.match(await text(page, '#link-chip'), /±[\d.]+ mm ±[\d.]+ °, growing$/);
  assert.match(await text(page, '#ladder-chip'), /link lost/);
  assert.ok(await page.isHidden('#banner'), 'the panel itself answers');
  await holds(page, (since) => Number(/link lost for (\d+) s/.exec(document.querySelector('#link-chip').textContent)?.[1]) >= since + 2, since);
  assert.ok(await sigma() > uncertain, 'it grows');
  passed(await text(page, '#link-chip'));

  // An order is refused, and nothing moves when the board is back.
  const before = await text(page, '#axes .now');
  await page.click('#modes button:has-text("herbivore")');
  await holds(page, () => /the order is refused/.test(document.querySelector('#log').textContent));
  passed('an order is refused');
  await shot(page, 'link-lost');
  assert.deepEqual(await serious(page), []);
  await holds(page, () => /link .* ms/.test(document.querySelector('#link-chip').textContent));
  passed(await text(page, '#link-chip'));
  await holds(page, () => !/link lost/.test(document.querySelector('#ladder-chip').textContent) && document.querySelector('#state').textContent === 'idle');
  await holds(page, () => /back after/.test(document.querySelector('#log').textContent));
  assert.equal(await text(page, '#axes .now'), before);
  passed('the link is back, and nothing moved');

  // It drives again, without a restart.
  // The search for what is serious keeps a page busy, on a machine with much else to do for so long that the page gives up control.
  if (!(await text(page, '#who')).startsWith('you drive')) {
    await page.click('#take');
    await holds(page, () => document.querySelector('#who').textContent.startsWith('you drive'));
  }
  await page.click('#modes button:has-text("human")');
  await holds(page, () => document.querySelector('#modes [aria-pressed="true"]')?.textContent === 'human');
  passed('it drives again');
});
