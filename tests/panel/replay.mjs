// Watches with a real browser a recording that `vergence replay --panel` plays: see tests/panel.rs.
//
// Arguments: the browser, the address of the panel, the folder for pictures.
import assert from 'node:assert/strict';
import { browse } from './browser.mjs';

const [executablePath, url] = process.argv.slice(2);
await browse(executablePath, async ({ open, holds, text, shot, passed, serious }) => {
  const page = await open(url, { viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  const played = (page) => page.evaluate(() => Number.parseFloat(document.querySelector('#played').textContent));
  await holds(page, () => /points of/.test(document.querySelector('#cloud-chip').textContent));
  assert.match(await text(page, '#recorded'), /^A recording of .*20\d\d/);
  assert.match(await text(page, '#who'), /nothing can be driven/);
  assert.match(await text(page, '#rig-name'), /simulated/);
  assert.ok(!await page.isVisible('#stop') && !await page.isVisible('#take'), 'there is no rig to stop or to drive');
  for (const button of await page.locator('#modes button, #home').all()) {
    assert.ok(await button.isDisabled());
    assert.match(await button.getAttribute('title'), /recording/);
  }
  passed(`a cloud of ${await text(page, '#recorded')} ${await text(page, '#played')}`);

  // The space bar holds it, whatever has the focus, and lets it go on.
  await page.focus('#place');
  await page.keyboard.press('Space');
  await holds(page, () => /paused$/.test(document.querySelector('#played').textContent));
  const held = await played(page);
  await page.waitForTimeout(700);
  assert.equal(await played(page), held, 'it stands');
  await page.click('#hold');
  await holds(page, (held) => Number.parseFloat(document.querySelector('#played').textContent) > held, held);
  passed(`held at ${held} s`);

  // To its end, which stays, and back to where the stages moved.
  await holds(page, () => /over$/.test(document.querySelector('#played').textContent));
  await holds(page, () => document.querySelectorAll('#log li').length > 1);
  await page.evaluate(() => {
    const slider = document.querySelector('#place');
    slider.value = String(Number(slider.max) - 1);
    slider.dispatchEvent(new Event('input'));
    slider.dispatchEvent(new Event('change'));
  });
  await holds(page, () => !/over$/.test(document.querySelector('#played').textContent));
  await holds(page, () => /over$/.test(document.querySelector('#played').textContent));
  await shot(page, 'replay');
  passed(`played from elsewhere: ${await text(page, '#played')}; ${await text(page, '#log li')}`);

  const phone = await open(url, { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: 'light' });
  await holds(phone, () => /points of/.test(document.querySelector('#cloud-chip').textContent));
  assert.ok(await phone.evaluate(() => document.documentElement.scrollWidth) <= 390, 'it fits a phone');
  for (const [shown, name] of [[page, 'dark'], [phone, 'light']]) assert.deepEqual(await serious(shown), [], name);
  passed('a phone shows the same; axe finds nothing serious');
});
