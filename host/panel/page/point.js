// A picked point: range, uncertainty, both patches of the images, and why it is trusted.
const PATCH_PX = 33;

export function showPoint(link, cloud, pictures) {
  const panel = document.getElementById('point');
  const element = (name, text) => {
    const made = document.createElement(name);
    if (text !== undefined) made.textContent = text;
    return made;
  };

  function patch(image, u, v, label) {
    const canvas = element('canvas');
    canvas.width = canvas.height = PATCH_PX;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', label);
    const context = canvas.getContext('2d');
    context.imageSmoothingEnabled = false;
    const half = PATCH_PX / 2;
    if (image) {
      const scale = image.bitmap.width / image.width;
      const [x, y, size] = [u + 0.5 - half, v + 0.5 - half, PATCH_PX].map((pixels) => scale * pixels);
      context.drawImage(image.bitmap, x, y, size, size, 0, 0, PATCH_PX, PATCH_PX);
    }
    context.strokeStyle = '#fff';
    context.strokeRect(Math.floor(half) - 2.5, Math.floor(half) - 2.5, 6, 6);
    return canvas;
  }

  // Standard deviations along the axes of the ellipsoid: roots of the eigenvalues of a symmetric matrix (Smith, 1961).
  function axes([xx, xy, xz, yy, yz, zz]) {
    const mean = (xx + yy + zz) / 3;
    const spread = Math.sqrt(((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * (xy * xy + xz * xz + yz * yz)) / 6);
    if (!(spread > 0)) return [mean, mean, mean].map(Math.sqrt);
    const [a, d, f] = [xx, yy, zz].map((value) => (value - mean) / spread);
    const [b, c, e] = [xy, xz, yz].map((value) => value / spread);
    const half = (a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)) / 2;
    const angle = Math.acos(Math.min(Math.max(half, -1), 1)) / 3;
    return [0, 1, 2].map((third) => Math.sqrt(Math.max(mean + 2 * spread * Math.cos(angle - third * 2 * Math.PI / 3), 0)));
  }

  function reasons(message, point, [misses, score]) {
    const told = message.pose_by_images ? `joints and the matches of ${message.told_by_pairs} pairs told the pose` : 'the encoders told the pose';
    return [
      `its rays miss each other by ${Math.abs(misses).toFixed(1)} σ`,
      `the match is right with ${(100 * score).toFixed(0)} %`,
      told,
      message.calibration_known ? 'the covariance has the calibration in it' : 'the calibration is unknown: the covariance lacks it',
      message.colours[16 * point + 15] < 255 ? 'a lens is extrapolated there' : 'both lenses are measured there',
    ];
  }

  cloud.onPick((message, point) => {
    pictures.mark(point);
    panel.hidden = point === null;
    if (point === null) return;
    const detail = Array.from({ length: 13 }, (_, i) => message.detail(point, i));
    const [x, y, z] = message.place(point);
    const close = element('button', '×');
    close.type = 'button';
    close.setAttribute('aria-label', 'close');
    close.addEventListener('click', cloud.unpick);
    const head = element('h3', `${Math.hypot(x, y, z).toFixed(1)} ± ${detail[10].toPrecision(2)} mm`);
    const patches = element('div');
    patches.className = 'patches';
    patches.append(
      patch(pictures.images.left, detail[6], detail[7], 'the place in the left image'),
      patch(pictures.images.right, detail[8], detail[9], 'the place in the right image'),
    );
    const sigmas = axes(detail.slice(0, 6)).map((sigma) => sigma.toPrecision(2)).join(', ');
    const list = element('ul');
    list.append(...reasons(message, point, detail.slice(11)).map((text) => element('li', text)));
    panel.replaceChildren(
      close,
      head,
      element('p', `x ${x.toFixed(1)}, y ${y.toFixed(1)}, z ${z.toFixed(1)} mm`),
      element('p', `ellipsoid σ ${sigmas} mm, drawn at 3 σ`),
      patches,
      list,
    );
  });
}
