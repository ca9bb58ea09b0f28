// Watches with a real browser how `vergence calibrate stage --live --panel` takes its views: see tests/panel.rs.
//
// Arguments: the browser, the address of the panel, the folder for pictures.
import assert from 'node:assert/strict';
import { browse } from './browser.mjs';

const [executablePath, url] = process.argv.slice(2);
await browse(executablePath, async ({ open, holds, text, shot, passed, serious }) => {
  const page = await open(url, { viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  await holds(page, () => document.querySelectorAll('#capture-poses li').length >= 2);
  assert.match(await text(page, '#capture-poses li'), /pose 1 of 3 at .*: \d+ of \d+ views ✓$/);
  assert.match(await text(page, '#capture-advice'), /show|complete/);
  assert.ok(!await page.isVisible('#stop') && !await page.isVisible('#modes'), 'the command drives, not the page');
  passed(`${await text(page, '#capture-poses li:last-child')}; ${await text(page, '#capture-advice')}`);
  await shot(page, 'stage');

  await holds(page, () => document.querySelector('#capture-verdicts').childElementCount > 0);
  assert.equal(await page.locator('#capture-poses li').count(), 3);
  assert.match(await text(page, '#capture-verdicts'), /mm/);
  assert.deepEqual(await serious(page), []);
  await shot(page, 'staged');
  passed(await text(page, '#capture-verdicts li'));
});
