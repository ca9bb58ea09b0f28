// Several rigs: asks for all of them twice a second, and for the cloud of the one that is shown.
import { showCloud } from './cloud.js';

const EVERY_MS = 500;
const byId = (id) => document.getElementById(id);
const token = new URLSearchParams(location.search).get('token');
const address = (path) => path + (token ? `?token=${encodeURIComponent(token)}` : '');
const listeners = [];
const view = showCloud({ on: (kind, listener) => { if (kind === 'cloud') listeners.push(listener); } });
let [shown, clouds, moving] = [null, null, null];

const say = (text) => { byId('banner').textContent = text ?? ''; byId('banner').hidden = !text; };
const text = (value, unit = '') => (value === null || value === undefined ? '–' : `${value}${unit}`);

const rows = new Map();

// What a cell shows, with a line below in small letters.
function fill(cell, main, below) {
  const small = below ? [Object.assign(document.createElement('small'), { textContent: below })] : [];
  cell.replaceChildren(main, ...small);
}

function chip(health) {
  const kind = { ok: 'good', warning: 'moves' }[health] ?? 'bad';
  return Object.assign(document.createElement('span'), { className: `chip ${kind}`, textContent: health });
}

// A row stays while its rig is known, so that a click on it is never lost.
function row(name) {
  const made = byId('list').insertRow();
  for (let cell = 0; cell < 8; cell += 1) made.insertCell();
  const button = Object.assign(document.createElement('button'), { type: 'button', textContent: name });
  button.addEventListener('click', () => show(name));
  made.cells[0].append(button);
  rows.set(name, made);
  return made;
}

function list(rigs) {
  for (const rig of rigs) {
    const of = rows.get(rig.name) ?? row(rig.name);
    of.classList.toggle('shown', rig.name === shown);
    of.querySelector('button').setAttribute('aria-pressed', rig.name === shown);
    const [, health, mode, axes, points, sigma, age, lost] = of.cells;
    fill(health, chip(rig.health), rig.message);
    fill(mode, text(rig.mode), rig.state);
    fill(axes, rig.axes?.join(', ') || '–');
    fill(points, text(rig.points));
    fill(sigma, text(rig.sigma_mm?.toFixed(1), ' mm'));
    fill(age, text(rig.cloud_age_s?.toFixed(1), ' s'));
    fill(lost, text(rig.lost));
  }
}

// A button for each mode, where this page may order and the rig takes orders.
function modes(rig, mayOrder) {
  const names = mayOrder && rig?.takes_orders ? rig.modes ?? [] : [];
  const now = names.map((name) => `${rig.name}/${name}`).join();
  if (byId('modes').dataset.now !== now) {
    byId('modes').dataset.now = now;
    byId('modes').replaceChildren(...names.map((name) => {
      const button = Object.assign(document.createElement('button'), { type: 'button', textContent: name });
      button.addEventListener('click', () => order(rig.name, name));
      return button;
    }));
  }
  for (const button of byId('modes').children) {
    button.disabled = moving !== null;
    button.setAttribute('aria-pressed', button.textContent === rig.mode);
  }
}

async function order(rig, mode) {
  moving = rig;
  say(`${rig} goes to ${mode}`);
  const answer = await fetch(address(`/rigs/${rig}/mode/${encodeURIComponent(mode)}`), { method: 'POST' }).catch(() => null);
  moving = null;
  say(answer?.ok ? null : await answer?.text() ?? 'The panel does not answer.');
}

function show(name) {
  [shown, clouds] = [name, null];
  byId('shown').textContent = name;
  byId('modes').replaceChildren();
  delete byId('modes').dataset.now;
  view.unpick();
}

// The header and what follows it: see `packed` in the panel's messages.
async function cloud(rig) {
  const answer = await fetch(address(`/rigs/${rig}/cloud`));
  if (!answer.ok || rig !== shown) return;
  const buffer = await answer.arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  listeners.forEach((listener) => listener({ ...header, buffer, at: 4 + length }));
}

async function ask() {
  try {
    const answer = await fetch(address('/rigs'));
    if (!answer.ok) throw new Error(await answer.text());
    const { rigs, may_order: mayOrder } = await answer.json();
    if (shown === null && rigs.length > 0) show(rigs[0].name);
    list(rigs);
    const rig = rigs.find(({ name }) => name === shown);
    modes(rig, mayOrder);
    const well = rigs.filter(({ health }) => health === 'ok').length;
    byId('summary').textContent = rigs.length ? `${rigs.length} rigs, ${well} well` : 'no rig is heard yet';
    if (rig?.clouds && rig.clouds !== clouds) {
      clouds = rig.clouds;
      await cloud(rig.name);
    }
    if (byId('banner').dataset.closed) { delete byId('banner').dataset.closed; say(null); }
  } catch (error) {
    byId('banner').dataset.closed = 'yes';
    say(`The panel does not answer: ${error.message}`);
  }
  setTimeout(ask, EVERY_MS);
}
ask();
