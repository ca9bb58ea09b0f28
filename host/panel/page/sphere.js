// All directions around the rig: which cameras see them, and how well a range would be known there.
import { scale, share, style } from './colours.js';
import { fitted } from './link.js';

// Ends of the scale of the predicted standard deviation, in millimetres, as the legend of the page has them.
const ENDS = [0.1, 10];

export function showSphere(link) {
  const canvas = document.getElementById('sphere');
  let map = null;
  const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const again = fitted(canvas, (dots) => {
    const context = canvas.getContext('2d');
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (!map) return;
    const { columns, rows, buffer, at } = map;
    const cells = columns * rows;
    const sigmas = new Float32Array(buffer, at, cells);
    const seen = new Uint8Array(buffer, at + 4 * cells, cells);
    const image = new ImageData(columns, rows);
    const plain = ['blind', 'left', 'right'].map((name) => rgb(style(name)));
    for (let cell = 0; cell < cells; cell += 1) {
      const known = seen[cell] === 3 && Number.isFinite(sigmas[cell]);
      // What one camera sees is dimmed, so that what both see stands out.
      const dimmed = (colour) => colour.map((value, i) => (0.45 * value + 0.55 * plain[0][i]));
      const colour = known ? scale(1 - share(sigmas[cell], ...ENDS)) : seen[cell] === 3 ? [0, 34, 78]
        : seen[cell] === 0 ? plain[0] : dimmed(plain[seen[cell]]);
      image.data.set([...colour, 255], 4 * cell);
    }
    const small = new OffscreenCanvas(columns, rows);
    small.getContext('2d').putImageData(image, 0, 0);
    const width = Math.min(canvas.width, 2 * canvas.height);
    const left = (canvas.width - width) / 2;
    context.translate(0, (canvas.height - width / 2) / 2);
    context.imageSmoothingEnabled = false;
    context.drawImage(small, left, 0, width, width / 2);
    marks(context, left, width, dots);
  });

  function marks(context, left, width, dots) {
    context.strokeStyle = style('grid');
    context.lineWidth = dots;
    context.beginPath();
    for (let part = 1; part < 4; part += 1) {
      context.moveTo(left + width * part / 4, 0);
      context.lineTo(left + width * part / 4, width / 2);
      context.moveTo(left, width * part / 8);
      context.lineTo(left + width, width * part / 8);
    }
    context.stroke();
    context.font = `${11 * dots}px system-ui`;
    context.textAlign = 'center';
    for (const [text, part] of [['behind', 0.07], ['left', 0.25], ['forward', 0.5], ['right', 0.75]]) {
      const [x, y] = [left + width * part, width / 2 - 5 * dots];
      context.lineWidth = 3 * dots;
      context.strokeStyle = '#000a';
      context.strokeText(text, x, y);
      context.fillStyle = '#fff';
      context.fillText(text, x, y);
    }
  }

  link.on('sphere', (message) => {
    map = message;
    const percent = (part) => `${(100 * message.shares[part]).toFixed(1)} %`;
    const text = `both ${percent('stereo')}, one ${percent('mono')}, none ${percent('blind')}; σ of a range of ${message.range_mm} mm for `
      + `matches good to ${message.pixel_sigma} px`;
    document.getElementById('shares').textContent = text;
    canvas.setAttribute('aria-label', `Map of all directions: ${text}`);
    again();
  });
}
