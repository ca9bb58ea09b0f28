// The last minute: axes, their distance to where they are sent, residuals and latency.
import { MATCHES, style } from './colours.js';
import { fitted } from './link.js';

const SECONDS = 60;

export function showPlots(link) {
  const canvas = document.getElementById('plots');
  let axes = [];
  // A recording does not know where the axes were sent.
  let knowsTargets = true;
  let series = [];
  const now = () => performance.now() / 1000;
  // Of every series: its name, unit, and points of time and value.
  const add = (name, unit, value) => {
    let one = series.find((known) => known.name === name);
    if (!one) {
      one = { name, unit, points: [] };
      series.push(one);
    }
    one.points.push([now(), value]);
    while (one.points.length && one.points[0][0] < now() - SECONDS) one.points.shift();
  };
  const again = fitted(canvas, draw);

  function draw(dots) {
    const context = canvas.getContext('2d');
    context.clearRect(0, 0, canvas.width, canvas.height);
    const shown = series.filter(({ points }) => points.length > 1);
    const wide = canvas.width > 420 * dots ? 2 : 1;
    const rows = Math.ceil(shown.length / wide);
    const [width, height] = [canvas.width / wide, canvas.height / Math.max(rows, 1)];
    shown.forEach((one, i) => {
      context.save();
      context.translate((i % wide) * width, Math.floor(i / wide) * height);
      plot(context, one, [width - 10 * dots, height], MATCHES[i % MATCHES.length], dots);
      context.restore();
    });
  }

  function plot(context, { name, unit, points }, [width, height], colour, dots) {
    const values = points.map(([, value]) => value);
    let [low, high] = [Math.min(...values), Math.max(...values)];
    const least = Math.max(Math.abs(high), 1) * 0.02;
    if (high - low < least) [low, high] = [low - least / 2, high + least / 2];
    const [top, bottom] = [17 * dots, height - 7 * dots];
    context.font = `${11 * dots}px system-ui`;
    context.fillStyle = style('muted');
    context.fillText(`${name}: ${values.at(-1).toFixed(2)} ${unit}`, 0, 11 * dots);
    context.fillText(high.toFixed(1), 4 * dots, top + 12 * dots);
    context.fillText(low.toFixed(1), 4 * dots, bottom - 4 * dots);
    context.strokeStyle = style('grid');
    context.lineWidth = dots;
    context.strokeRect(0, top, width, Math.max(bottom - top, 1));
    context.strokeStyle = colour;
    context.lineWidth = 2 * dots;
    context.beginPath();
    const end = now();
    points.forEach(([time, value], i) => {
      const [x, y] = [width * (1 - (end - time) / SECONDS), bottom - (bottom - top) * (value - low) / (high - low)];
      if (i === 0) context.moveTo(x, y); else context.lineTo(x, y);
    });
    context.stroke();
  }

  link.on('hello', (hello) => {
    axes = hello.axes;
    knowsTargets = hello.recorded_ms === null;
    series = [];
  });
  let latest = 0;
  link.on('status', ({ values, targets }) => {
    // Five points a second are enough for a minute.
    if (now() - latest < 0.2) return;
    latest = now();
    axes.forEach(({ name, unit }, i) => add(name, unit, values[i]));
    if (knowsTargets) axes.forEach(({ name, unit }, i) => add(`${name} to its target`, unit, targets ? targets[i] - values[i] : 0));
    const text = series.map(({ name, unit, points }) => `${name} ${points.at(-1)[1].toFixed(1)} ${unit}`).join(', ');
    canvas.setAttribute('aria-label', `Plots of the last minute: ${text}`);
    again();
  });
  link.on('cloud', ({ residual_sigmas: residual, latency_ms: latency }) => {
    if (typeof residual === 'number') add('residual of the rays', 'σ', residual);
    add('latency', 'ms', latency);
    again();
  });
}
