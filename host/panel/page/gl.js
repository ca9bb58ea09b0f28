// The few parts of WebGL that the cloud needs. Matrices are 4 by 4, column by column.
export function program(gl, vertex, fragment) {
  const built = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(built, shader);
  }
  gl.linkProgram(built);
  if (!gl.getProgramParameter(built, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(built));
  return built;
}

export function product(a, b) {
  const result = new Float32Array(16);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      for (let i = 0; i < 4; i += 1) result[4 * column + row] += a[4 * i + row] * b[4 * column + i];
    }
  }
  return result;
}

export function perspective(aspect, near, far) {
  const f = 1.6;
  return new Float32Array([f / Math.max(aspect, 1), 0, 0, 0, 0, f * Math.min(aspect, 1), 0, 0, 0, 0, (far + near) / (near - far), -1,
    0, 0, 2 * far * near / (near - far), 0]);
}

// Looks at `centre` from `distance`, turned by `yaw` to the right and by `pitch` downwards, with the rig's axes: x right, y down, z forward.
export function orbit(centre, distance, yaw, pitch) {
  const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
  // Rows: right, up, and backward of the viewer.
  const rows = [[cy, 0, -sy], [sy * sp, -cp, cy * sp], [-sy * cp, -sp, -cy * cp]];
  const shift = rows.map((row) => -row.reduce((sum, value, i) => sum + value * centre[i], 0));
  shift[2] -= distance;
  return new Float32Array([
    rows[0][0], rows[1][0], rows[2][0], 0, rows[0][1], rows[1][1], rows[2][1], 0, rows[0][2], rows[1][2], rows[2][2], 0, ...shift, 1,
  ]);
}

export function applied(m, [x, y, z]) {
  return [0, 1, 2, 3].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);
}

// A rigid transform given row by row, three rows of four numbers.
export const rigid = (r) => new Float32Array([r[0], r[4], r[8], 0, r[1], r[5], r[9], 0, r[2], r[6], r[10], 0, r[3], r[7], r[11], 1]);
