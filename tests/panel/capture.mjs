// Watches with a real browser how `vergence capture --panel` fills a set of target views: see tests/panel.rs.
//
// Arguments: the browser, the address of the panel, the folder for pictures.
import assert from 'node:assert/strict';
import { browse } from './browser.mjs';

const [executablePath, url, pictures] = process.argv.slice(2);
await browse(executablePath, async ({ open, holds, text, shot, passed, serious }) => {
  const page = await open(url, { viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  await holds(page, () => Number.parseInt(document.querySelector('#capture-count').textContent, 10) > 2);
  await holds(page, () => /show the target/.test(document.querySelector('#capture-advice').textContent));
  const before = await page.evaluate(() => document.querySelector('#capture-progress').value);
  assert.ok(before > 0, 'some cells are covered');
  assert.ok(!await page.isVisible('#stop'), 'nothing moves');
  passed(await text(page, '#capture-advice'));
  await shot(page, 'capturing');

  await holds(page, () => document.querySelector('#capture-verdicts').childElementCount === 2);
  const after = await page.evaluate(() => document.querySelector('#capture-progress').value);
  assert.ok(after > before, `coverage grew from ${before} to ${after}`);
  assert.match(await text(page, '#capture-verdicts'), /left camera: .* mm at 350 mm.*right camera: /);
  passed(await text(page, '#capture-verdicts li'));
  await shot(page, 'captured');

  const phone = await open(url, { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: 'light' });
  await holds(phone, () => document.querySelector('#capture-verdicts').childElementCount === 2);
  assert.ok(await phone.evaluate(() => document.documentElement.scrollWidth) <= 390, 'it fits a phone');
  for (const [shown, name] of [[page, 'dark'], [phone, 'light']]) assert.deepEqual(await serious(shown), [], name);
  passed('a phone shows the same; axe finds nothing serious');
});
