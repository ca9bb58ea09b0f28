// The rig from above: cameras, their fields, the zones around them, and the trunk of a robot.
import { style } from './colours.js';
import { fitted } from './link.js';

export function showTopView(link) {
  const canvas = document.getElementById('top-view');
  let view = null;
  // Angles to the right of forward become those of the canvas.
  const turned = (deg) => (deg - 90) * Math.PI / 180;

  const again = fitted(canvas, (dots) => {
    const context = canvas.getContext('2d');
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (!view) return;
    const reach = Math.min(canvas.width, canvas.height) / 2;
    const zoom = reach / (view.radius_mm * 1.12);
    context.translate(canvas.width / 2, canvas.height / 2);
    const radius = view.radius_mm * zoom;
    const at = ([right, forward]) => [right * zoom, -forward * zoom];
    fields(context, at, radius);
    zones(context, radius, dots);
    if (view.trunk) trunk(context, at, dots);
    cameras(context, at, dots);
    context.fillStyle = style('muted');
    context.font = `${11 * dots}px system-ui`;
    context.textAlign = 'center';
    context.fillText(`${view.radius_mm} mm`, 0, -radius + 20 * dots);
  });

  function fields(context, at, radius) {
    context.save();
    context.beginPath();
    context.arc(0, 0, radius, 0, 2 * Math.PI);
    context.clip();
    view.cameras.forEach(({ place, axis_deg: axis, half_field_deg: half }, i) => {
      const [x, y] = at(place);
      context.beginPath();
      context.moveTo(x, y);
      context.arc(x, y, 3 * radius, turned(axis - half), turned(axis + half));
      context.closePath();
      context.globalAlpha = 0.22;
      context.fillStyle = style(['left', 'right'][i]);
      context.fill();
      context.globalAlpha = 0.8;
      context.strokeStyle = style(['left', 'right'][i]);
      context.setLineDash([6, 6]);
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + 3 * radius * Math.cos(turned(axis)), y + 3 * radius * Math.sin(turned(axis)));
      context.stroke();
      context.setLineDash([]);
    });
    context.restore();
  }

  function zones(context, radius, dots) {
    const names = ['blind', 'muted', 'stereo'];
    for (const [start, end, seenBy] of view.arcs) {
      context.beginPath();
      context.arc(0, 0, radius, turned(start), turned(end));
      context.strokeStyle = style(names[seenBy]);
      context.lineWidth = [5, 5, 11][seenBy] * dots;
      context.setLineDash(seenBy === 0 ? [3 * dots, 5 * dots] : []);
      context.stroke();
    }
    context.setLineDash([]);
  }

  function trunk(context, at, dots) {
    context.beginPath();
    view.trunk.forEach((corner, i) => (i === 0 ? context.moveTo(...at(corner)) : context.lineTo(...at(corner))));
    context.closePath();
    context.lineJoin = 'round';
    context.lineWidth = 9 * dots;
    context.strokeStyle = style('muted');
    context.stroke();
  }

  function cameras(context, at, dots) {
    const [left, right] = view.cameras;
    if (!view.trunk) {
      context.strokeStyle = style('muted');
      context.lineWidth = 5 * dots;
      context.beginPath();
      context.moveTo(...at(left.place));
      context.lineTo(...at(right.place));
      context.stroke();
    }
    view.cameras.forEach(({ place, axis_deg: axis }, i) => {
      context.save();
      context.translate(...at(place));
      context.rotate(axis * Math.PI / 180);
      context.fillStyle = style(['left', 'right'][i]);
      context.strokeStyle = style('card');
      context.lineWidth = 2 * dots;
      context.beginPath();
      context.roundRect(-9 * dots, -5 * dots, 18 * dots, 16 * dots, 3 * dots);
      context.fill();
      context.stroke();
      context.beginPath();
      context.arc(0, -5 * dots, 7 * dots, Math.PI, 0);
      context.fill();
      context.stroke();
      context.restore();
    });
  }

  link.on('view', (message) => {
    view = message;
    const zones = message.zones_deg;
    const text = zones
      ? `circle of ${message.radius_mm} mm: both cameras ${zones.stereo.toFixed(1)}°, one ${zones.mono.toFixed(1)}°, none ${zones.blind.toFixed(1)}°`
      : 'a camera stands outside the circle';
    document.getElementById('zones').textContent = [text, message.closure].filter(Boolean).join('; ');
    canvas.setAttribute('aria-label', `The rig from above. ${text}`);
    again();
  });
}
