// A real browser for the tests of the panel.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import assert from 'node:assert/strict';
import { chromium } from 'playwright-core';

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
// The machine that runs the tests may be busy.
const timeout = 120000;

// Lets `story` use the browser at `executablePath`. Pages must not complain. Pictures go to the folder in the last argument of the command line.
export async function browse(executablePath, story) {
  const pictures = process.argv.at(-1);
  const begun = Date.now();
  const complaints = [];
  const browser = await chromium.launch({
    executablePath, args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
  });
  const tools = {
    async open(url, options) {
      const context = await browser.newContext({ bypassCSP: false, ...options });
      const page = await context.newPage();
      page.setDefaultTimeout(timeout);
      page.on('pageerror', (error) => complaints.push(String(error)));
      page.on('console', (said) => { if (said.type() === 'error' && !said.text().includes('WebSocket')) complaints.push(said.text()); });
      await page.goto(url);
      return page;
    },
    holds: (page, test, argument) => page.waitForFunction(test, argument, { timeout }),
    text: (page, selector) => page.locator(selector).first().textContent(),
    shot: (page, name, fullPage = false) => page.screenshot({ path: `${pictures}/${name}.png`, fullPage }),
    passed: (what) => console.error(`${((Date.now() - begun) / 1000).toFixed(1)} s  ${what}`),
    // What axe finds that is serious.
    async serious(page) {
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => window.axe.run());
      const found = violations.filter(({ impact }) => ['serious', 'critical'].includes(impact));
      return found.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target).join(' ')}`);
    },
  };
  try {
    await story(tools);
    assert.deepEqual(complaints, [], 'the page complained');
  } finally {
    await browser.close();
  }
  process.exit(0);
}
