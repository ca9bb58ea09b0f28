// The cloud: points and cameras in the frame of the rig's base. Drag turns it, the wheel zooms, a click picks a point.
import { scale, share, style } from './colours.js';
import { applied, orbit, perspective, product, program, rigid } from './gl.js';
import { fitted } from './link.js';

// Floats behind the points: see `cloud_message` in the panel.
const DETAILS = 13;
// Ends of the scales of range and of its standard deviation, in millimetres.
const ENDS = { range: [200, 5000], sigma: [0.1, 100] };
const VERTEX = `attribute vec3 place; attribute vec4 colour; uniform mat4 all; uniform float size; varying vec4 shown;
  void main() { gl_Position = all * vec4(place, 1.0); gl_PointSize = size; shown = colour; }`;
const FRAGMENT = `precision mediump float; varying vec4 shown; uniform bool round;
  void main() { if (round && distance(gl_PointCoord, vec2(0.5)) > 0.5) discard; gl_FragColor = vec4(shown.rgb, 1.0); }`;

// The cloud of a message, with the numbers of each point.
function withDetails(message) {
  const { buffer, at, count } = message;
  const details = new Float32Array(buffer, at + 16 * count, DETAILS * count);
  const places = new Float32Array(buffer, at, 4 * count);
  return Object.assign(message, {
    detail: (point, i) => details[DETAILS * point + i],
    place: (point) => [0, 1, 2].map((axis) => places[4 * point + axis]),
    colours: new Uint8Array(buffer, at, 16 * count),
  });
}

export function showCloud(link) {
  const canvas = document.getElementById('cloud');
  const gl = canvas.getContext('webgl', { antialias: true, preserveDrawingBuffer: true });
  const colourBy = document.getElementById('colour-by');
  const eye = { yaw: 0.5, pitch: 0.35, distance: 2600, centre: [0, 0, 700] };
  const pickers = [];
  let [cloud, picked] = [null, null];
  const tell = () => pickers.forEach((told) => told(cloud, picked));
  link.on('cloud', (message) => {
    const before = picked === null ? null : inBase(picked);
    cloud = withDetails(message);
    if (before) {
      picked = nearest(before);
      tell();
    }
    again();
  });
  if (!gl) {
    document.getElementById('cloud-hint').textContent = 'this browser has no WebGL: the cloud cannot be drawn';
  }
  const built = gl && program(gl, VERTEX, FRAGMENT);
  const buffer = gl && gl.createBuffer();
  const again = gl ? fitted(canvas, draw) : () => {};

  const base = () => (cloud?.base_from_left ? rigid(cloud.base_from_left) : rigid([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]));
  const inBase = (point) => applied(base(), cloud.place(point)).slice(0, 3);
  // The point of the newest cloud that is where a picked one was, within a twentieth of its distance; `null` where none is.
  function nearest(place) {
    let [best, least] = [null, Math.hypot(...place) / 20];
    for (let point = 0; point < cloud.count; point += 1) {
      const away = Math.hypot(...inBase(point).map((value, axis) => value - place[axis]));
      if (away < least) [best, least] = [point, away];
    }
    return best;
  }
  const view = () => product(perspective(canvas.width / canvas.height, 20, 60000), orbit(eye.centre, eye.distance, eye.yaw, eye.pitch));

  function draw(dots) {
    gl.viewport(0, 0, canvas.width, canvas.height);
    const ground = rgb(style('card'));
    gl.clearColor(...ground.map((value) => value / 255), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(built);
    const seen = view();
    lines(floor(), seen);
    if (!cloud) return;
    for (const [side, pose] of [['left', cloud.base_from_left], ['right', cloud.base_from_right]]) {
      if (pose) lines(camera(rgb(style(side))), product(seen, rigid(pose)));
    }
    points(product(seen, base()), dots);
    if (picked !== null) lines(ellipsoid(picked), product(seen, base()));
  }

  function points(all, dots) {
    let bytes = new Uint8Array(cloud.buffer, cloud.at, 16 * cloud.count);
    const ends = ENDS[colourBy.value];
    if (ends) {
      bytes = bytes.slice();
      for (let point = 0; point < cloud.count; point += 1) {
        const value = colourBy.value === 'sigma' ? cloud.detail(point, 10) : Math.hypot(...cloud.place(point));
        bytes.set(scale(share(value, ...ends)), 16 * point + 12);
      }
    }
    show(bytes, gl.POINTS, cloud.count, all, 4.5 * dots, true);
  }

  function lines(vertices, all) {
    const bytes = new ArrayBuffer(16 * vertices.length);
    const [floats, colours] = [new Float32Array(bytes), new Uint8Array(bytes)];
    vertices.forEach(({ at, colour }, i) => { floats.set(at, 4 * i); colours.set([...colour, 255], 16 * i + 12); });
    show(colours, gl.LINES, vertices.length, all, 1, false);
  }

  // Draws vertices of 16 bytes: three floats and a colour.
  function show(bytes, kind, count, all, size, round) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STREAM_DRAW);
    const [place, colour] = ['place', 'colour'].map((name) => gl.getAttribLocation(built, name));
    gl.enableVertexAttribArray(place);
    gl.enableVertexAttribArray(colour);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 16, 0);
    gl.vertexAttribPointer(colour, 4, gl.UNSIGNED_BYTE, true, 16, 12);
    gl.uniformMatrix4fv(gl.getUniformLocation(built, 'all'), false, all);
    gl.uniform1f(gl.getUniformLocation(built, 'size'), size);
    gl.uniform1i(gl.getUniformLocation(built, 'round'), round ? 1 : 0);
    gl.drawArrays(kind, 0, count);
  }

  // A grid of half metres in the plane of the cameras.
  function floor() {
    const dark = matchMedia('(prefers-color-scheme: dark)').matches;
    const colour = dark ? [52, 61, 77] : [205, 212, 222];
    const ends = [];
    for (let at = -2000; at <= 2000; at += 500) {
      ends.push([at, 0, -1000], [at, 0, 3000], [-2000, 0, at + 1000], [2000, 0, at + 1000]);
    }
    return ends.map((at) => ({ at, colour }));
  }

  // A camera: the square of its view at 45 degrees, and its optical axis.
  function camera(colour) {
    const [size, square] = [45, [[-1, -1], [1, -1], [1, 1], [-1, 1]]];
    const corner = ([x, y]) => [size * x, size * y, size];
    const ends = square.flatMap((at, i) => [corner(at), corner(square[(i + 1) % 4]), [0, 0, 0], corner(at)]);
    return [...ends, [0, 0, 0], [0, 0, 160]].map((at) => ({ at, colour }));
  }

  // Three great ellipses of the surface at three standard deviations, at least as large as can be seen, with a cross in the middle.
  function ellipsoid(point) {
    const [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map((i) => cloud.detail(point, i));
    // A triangular root L of the covariance: L times a unit circle lies on the surface.
    const a = Math.sqrt(Math.max(xx, 1e-12));
    const [b, d] = [xy / a, xz / a];
    const c = Math.sqrt(Math.max(yy - b * b, 1e-12));
    const e = (yz - b * d) / c;
    const f = Math.sqrt(Math.max(zz - d * d - e * e, 1e-12));
    const middle = cloud.place(point);
    const on = ([u, v, w]) => [a * u, b * u + c * v, d * u + e * v + f * w].map((value, axis) => middle[axis] + 3 * value);
    const colour = rgb(style('ink'));
    const ends = [];
    for (let plane = 0; plane < 3; plane += 1) {
      for (let step = 0; step < 40; step += 1) {
        for (const turn of [step, step + 1]) {
          const circle = [Math.cos(turn * Math.PI / 20), Math.sin(turn * Math.PI / 20)];
          circle.splice(plane, 0, 0);
          ends.push(on(circle));
        }
      }
    }
    const arm = eye.distance / 60;
    for (let axis = 0; axis < 3; axis += 1) {
      for (const sign of [-arm, arm]) ends.push(middle.map((value, i) => value + (i === axis ? sign : 0)));
    }
    return ends.map((at) => ({ at, colour }));
  }

  function pick(point) {
    picked = point;
    again();
    tell();
  }

  // The point that is drawn nearest to a place on the canvas, within some pixels of the page.
  function pickAt(x, y) {
    if (!cloud?.count) return;
    const all = product(view(), base());
    let [best, least] = [null, 16];
    for (let point = 0; point < cloud.count; point += 1) {
      const [px, py, , w] = applied(all, cloud.place(point));
      if (w <= 0) continue;
      const away = Math.hypot((px / w + 1) / 2 * canvas.clientWidth - x, (1 - py / w) / 2 * canvas.clientHeight - y);
      if (away < least) [best, least] = [point, away];
    }
    pick(best);
  }

  const zoom = (factor) => { eye.distance = Math.min(Math.max(eye.distance * factor, 150), 20000); again(); };
  const turn = (right, down) => {
    eye.yaw += right;
    eye.pitch = Math.min(Math.max(eye.pitch + down, -1.5), 1.5);
    again();
  };
  const fingers = new Map();
  let moved = 0;
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (fingers.size === 0) moved = 0;
    fingers.set(event.pointerId, event);
  });
  canvas.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    moved += Math.abs(dx) + Math.abs(dy);
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (finger) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY);
      zoom(apart(before) / Math.max(apart(event), 1));
    } else {
      turn(-dx * 0.008, dy * 0.008);
    }
    fingers.set(event.pointerId, event);
  });
  canvas.addEventListener('pointerup', (event) => {
    fingers.delete(event.pointerId);
    if (moved < 6) {
      const box = canvas.getBoundingClientRect();
      pickAt(event.clientX - box.left, event.clientY - box.top);
    }
  });
  canvas.addEventListener('pointercancel', (event) => fingers.delete(event.pointerId));
  canvas.addEventListener('wheel', (event) => { event.preventDefault(); zoom(Math.exp(event.deltaY * 0.001)); }, { passive: false });
  canvas.addEventListener('keydown', (event) => {
    const next = (step) => cloud?.count && pick(((picked ?? (step > 0 ? -1 : 0)) + step + cloud.count) % cloud.count);
    const keys = {
      ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
      '+': () => zoom(0.85), '-': () => zoom(1.18), n: () => next(1), p: () => next(-1), Escape: () => pick(null),
    };
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  colourBy.addEventListener('change', again);
  return { onPick: (told) => pickers.push(told), unpick: () => pick(null) };
}

// The parts of a colour such as #1fb98a.
const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
