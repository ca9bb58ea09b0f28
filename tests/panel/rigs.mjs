// Watches three rigs on the page of `vergence peers --page` with a real browser, and sends one to a mode: see tests/peers.rs.
//
// Arguments: the browser, the address of the page, the folder for pictures.
import assert from 'node:assert/strict';
import { browse } from './browser.mjs';

const [executablePath, url, pictures] = process.argv.slice(2);
await browse(executablePath, async ({ open, holds, text, shot, passed, serious }) => {
  const page = await open(url, { viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  await holds(page, () => [...document.querySelectorAll('#list tr')].filter((row) => row.textContent.includes(' mm')).length === 3);
  await page.click('#list button:text("second")');
  await holds(page, () => document.querySelector('#shown').textContent === 'second');
  // Other colours than that of the ground: the cloud is drawn.
  await holds(page, () => {
    const gl = document.querySelector('#cloud').getContext('webgl');
    const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
    gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const seen = new Set();
    for (let at = 0; at < pixels.length; at += 4) seen.add((pixels[at] << 16) | (pixels[at + 1] << 8) | pixels[at + 2]);
    return seen.size > 20;
  });
  // A rig without a secret takes no orders.
  await holds(page, () => document.querySelector('#modes').dataset.now === '');
  assert.equal(await page.locator('#modes button').count(), 0);
  passed(await text(page, '#list'));
  await page.click('#list button:text("first")');
  for (const mode of ['human', 'herbivore']) {
    await page.click(`#modes button:text("${mode}")`);
    await holds(page, (name) => document.querySelector('#modes button[aria-pressed="true"]')?.textContent === name, mode);
    await holds(page, () => document.querySelector('#banner').hidden);
  }
  await shot(page, 'rigs');
  const phone = await open(url, { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: 'light' });
  await holds(phone, () => document.querySelectorAll('#list tr').length === 3);
  assert.ok(await phone.evaluate(() => document.documentElement.scrollWidth) <= 390, 'it fits a phone');
  for (const [shown, name] of [[page, 'dark'], [phone, 'light']]) assert.deepEqual(await serious(shown), [], name);
  passed('a phone shows the same; axe finds nothing serious');
});
