// The pose that measures as well as asked and sees the most, found by the panel; nothing moves before "Go there".
const SLIDERS = [
  // Name, unit, label, least, most, start; lengths by their logarithm.
  ['sigma_mm', 'mm', 'error at most', 0.1, 20, 1, true],
  ['range_mm', 'mm', 'at the distance', 100, 5000, 350, true],
  ['half_width_deg', '°', 'to both sides of forward', 0, 120, 40, false],
];

export function showPlan(link) {
  const [box, answer, go] = ['plan-sliders', 'plan-answer', 'plan-go'].map((id) => document.getElementById(id));
  let [found, waiting, asked] = [null, 0, false];
  const rows = SLIDERS.map(([name, unit, text, least, most, start, logarithmic]) => {
    const [to, from] = logarithmic ? [Math.log, Math.exp] : [Number, Number];
    const element = document.createElement('div');
    element.className = 'slider';
    const [label, slider, shown] = ['label', 'input', 'output'].map((kind) => document.createElement(kind));
    Object.assign(slider, { type: 'range', id: `plan-${name}`, min: to(least), max: to(most), step: 'any', value: to(start) });
    label.htmlFor = slider.id;
    label.textContent = text;
    const value = () => Number(from(Number(slider.value)).toPrecision(3));
    const show = () => { shown.textContent = `${value()} ${unit}`; };
    slider.addEventListener('input', () => {
      show();
      clearTimeout(waiting);
      waiting = setTimeout(ask, 250);
    });
    show();
    element.append(label, shown, slider);
    return { name, value, element };
  });
  box.append(...rows.map(({ element }) => element));
  const ask = () => {
    const goal = Object.fromEntries(rows.map(({ name, value }) => [name, value()]));
    link.send({ do: 'plan', forward: true, ...goal });
    answer.textContent = 'searching';
  };
  document.getElementById('plan').addEventListener('toggle', ({ target }) => {
    if (target.open && !asked) ask();
    asked = asked || target.open;
  });
  const enable = () => { go.disabled = !found || !link.drives; };
  go.addEventListener('click', () => found && link.send({ do: 'move', to: found.values }));
  let axes = [];
  link.on('hello', (hello) => { axes = hello.axes; });
  link.on('plan', (plan) => {
    found = plan;
    const place = axes.map(({ name, unit }, i) => `${name} ${plan.values[i].toFixed(1)} ${unit}`).join(', ');
    const sigma = plan.worst_sigma_mm === null ? 'some direction is not seen by both' : `σ at most ${plan.worst_sigma_mm.toPrecision(2)} mm`;
    answer.textContent = `${plan.meets_goal ? 'Met' : 'No pose meets it; the nearest'}: ${place}; ${sigma}; sees ${plan.seen_deg.toFixed(0)}°, `
      + `${plan.stereo_deg.toFixed(0)}° with both`;
    enable();
  });
  link.on('refused', ({ text }) => { if (answer.textContent === 'searching') answer.textContent = text; });
  link.on('control', enable);
  link.on('closed', enable);
}
