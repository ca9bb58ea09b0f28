// Both images, with the matched places in matching colours, and the picked one marked.
import { MATCHES, style } from './colours.js';
import { fitted } from './link.js';

const SIDES = ['left', 'right'];

export function showPictures(link) {
  const images = { left: null, right: null };
  let cloud = null;
  let picked = null;
  let overlay = null;
  const draws = SIDES.map((side, index) => {
    const canvas = document.getElementById(side);
    return fitted(canvas, (dots) => draw(canvas, side, index, dots));
  });
  const all = () => draws.forEach((again) => again());

  function draw(canvas, side, index, dots) {
    const context = canvas.getContext('2d');
    context.clearRect(0, 0, canvas.width, canvas.height);
    const image = images[side];
    if (!image) {
      context.fillStyle = style('muted');
      context.font = `${13 * dots}px system-ui`;
      context.textAlign = 'center';
      context.fillText('no image yet', canvas.width / 2, canvas.height / 2);
      return;
    }
    const zoom = Math.min(canvas.width / image.width, canvas.height / image.height);
    const [left, top] = [(canvas.width - zoom * image.width) / 2, (canvas.height - zoom * image.height) / 2];
    context.drawImage(image.bitmap, left, top, zoom * image.width, zoom * image.height);
    overlay?.(context, index, { zoom, left, top, dots });
    if (!cloud) return;
    const place = (point) => [0, 1].map((axis) => [left, top][axis] + zoom * (cloud.detail(point, 6 + 2 * index + axis) + 0.5));
    for (let point = 0; point < cloud.count; point += 1) {
      const [x, y] = place(point);
      context.fillStyle = MATCHES[point % MATCHES.length];
      context.beginPath();
      context.arc(x, y, 2 * dots, 0, 2 * Math.PI);
      context.fill();
    }
    if (picked !== null && picked < cloud.count) {
      const [x, y] = place(picked);
      for (const [colour, width] of [['#000', 5], ['#fff', 2]]) {
        context.strokeStyle = colour;
        context.lineWidth = width * dots;
        context.beginPath();
        context.arc(x, y, 9 * dots, 0, 2 * Math.PI);
        context.stroke();
      }
    }
  }

  // Width and height are those of the camera's image; the picture may be smaller.
  link.on('picture', async ({ side, width, height, buffer, at }) => {
    const bitmap = await createImageBitmap(new Blob([new Uint8Array(buffer, at)], { type: 'image/jpeg' }));
    images[side] = { bitmap, width, height };
    all();
  });
  link.on('cloud', (message) => {
    cloud = message;
    if (picked >= message.count) picked = null;
    for (const side of SIDES) {
      document.getElementById(side).setAttribute('aria-label', `Image of the ${side} camera, with ${message.count} matched places`);
    }
    all();
  });
  return {
    images,
    mark(point) { picked = point; all(); },
    // `paint` draws over the image of a side: context, number of the side, and where the image lies.
    cover(paint) { overlay = paint; all(); },
  };
}
