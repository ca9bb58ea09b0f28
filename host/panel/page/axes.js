// A slider and a number for every axis. The rig moves when the slider is let go or the number is entered.
// Arrow keys step a slider again and again: the rig goes where they have ended.
const PAUSE_MS = 250;
const byId = (id) => document.getElementById(id);

export function showAxes(link) {
  let rows = [];
  // Sliders follow the axes unless somebody holds them.
  let held = false;
  let waiting = 0;
  const go = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      held = false;
      link.send({ do: 'move', to: rows.map(({ slider }) => Number(slider.value)) });
    }, PAUSE_MS);
  };
  link.on('hello', ({ axes }) => {
    rows = axes.map((axis) => row(axis));
    byId('axes').replaceChildren(...rows.map(({ element }) => element));
    enable();
  });
  function row({ name, unit, least, most }) {
    const element = document.createElement('div');
    element.className = 'slider';
    const label = document.createElement('label');
    const [slider, number] = ['range', 'number'].map((type) => {
      const input = document.createElement('input');
      Object.assign(input, { type, min: least, max: most, step: 0.1, value: least });
      input.setAttribute('aria-label', `${name} in ${unit}`);
      return input;
    });
    slider.id = `axis-${name}`;
    label.htmlFor = slider.id;
    label.textContent = `${name} (${unit})`;
    const now = document.createElement('span');
    now.className = 'now';
    slider.addEventListener('input', () => { held = true; number.value = slider.value; });
    number.addEventListener('input', () => { held = true; });
    slider.addEventListener('change', go);
    number.addEventListener('change', () => { slider.value = number.value; go(); });
    element.append(label, number, slider, now);
    return { element, slider, number, now, unit };
  }
  function enable() {
    for (const { slider, number } of rows) slider.disabled = number.disabled = !link.drives;
  }
  link.on('control', enable);
  link.on('closed', enable);
  link.on('status', ({ values, targets, referenced }) => {
    rows.forEach(({ slider, number, now, unit }, i) => {
      const at = values[i];
      const there = targets ? `, goes to ${targets[i].toFixed(1)}` : '';
      now.textContent = `now ${at.toFixed(2)} ${unit}${there}${referenced[i] ? '' : ' (no reference)'}`;
      const shown = targets ? targets[i] : at;
      if (!held && document.activeElement !== number) {
        slider.value = shown;
        number.value = shown.toFixed(1);
      }
    });
  });
}
