// A calibration while it is taken: how far the cells of both images are covered, what to show next, and the verdict.
import { style } from './colours.js';

const byId = (id) => document.getElementById(id);
const CELLS = 3;

export function showCapture(link, pictures) {
  link.on('capture', (progress) => {
    const { views, wanted, advice, cameras, poses, verdicts, is_still: isStill } = progress;
    document.body.classList.add('captures');
    document.body.classList.toggle('mono', cameras.length === 1);
    byId('capture').hidden = false;
    const isOver = verdicts.length > 0;
    byId('state').textContent = isOver ? 'calibrated' : 'calibrating';
    byId('state').className = `chip strong ${isOver ? 'good' : 'moves'}`;
    const shares = cameras.flatMap(({ cells }) => cells.flat()).filter((share) => share !== null);
    byId('capture-progress').max = shares.length || 1;
    byId('capture-progress').value = shares.reduce((sum, share) => sum + share, 0);
    const seen = cameras.some(({ corners }) => corners.length > 0);
    const target = isOver ? '' : !seen ? '; no target seen' : isStill ? '; the target is held still' : '; the target moves: hold it still';
    // At each pose of a stage there are so many views, whatever they cover.
    const drives = poses.length > 0;
    const most = drives ? `${views} of ${wanted} views at this pose` : `${views} views (${wanted} at most)`;
    byId('capture-count').textContent = cameras.length ? `${most}${target}` : '';
    const complete = drives ? isOver ? 'The views are taken.' : 'show the target elsewhere, or tilted' : 'The set is complete.';
    const said = advice === null || (drives && isOver) ? complete : isOver ? 'The views are taken, but not all that are needed.' : advice;
    // Set only when it changes: a screen reader says it again otherwise.
    if (byId('capture-advice').textContent !== said) byId('capture-advice').textContent = said;
    byId('capture-poses').replaceChildren(...poses.map(({ name, views: taken }) => {
      const item = document.createElement('li');
      item.textContent = `${name}: ${taken} of ${wanted} views${taken >= wanted ? ' ✓' : ''}`;
      return item;
    }));
    if (byId('capture-verdicts').childElementCount !== verdicts.length) {
      byId('capture-verdicts').replaceChildren(...verdicts.map((verdict) => {
        const item = document.createElement('li');
        item.textContent = verdict;
        return item;
      }));
    }
    pictures.cover((context, side, place) => {
      if (cameras[side]) paint(context, cameras[side], isStill, place);
    });
  });
}

// Cells that lack views are dark and say how much they have; those that have enough are clear.
function paint(context, { size, cells, corners }, isStill, { zoom, left, top, dots }) {
  const [width, height] = size.map((pixels) => pixels * zoom / CELLS);
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.font = `600 ${16 * dots}px system-ui`;
  cells.forEach((row, j) => row.forEach((share, i) => {
    if (share === null) return;
    const [x, y] = [left + i * width, top + j * height];
    if (share < 1) {
      context.fillStyle = '#0009';
      context.fillRect(x, y, width, height);
    }
    context.strokeStyle = '#ffffff66';
    context.lineWidth = dots;
    context.strokeRect(x, y, width, height);
    const [label, colour] = share < 1 ? [`${Math.round(100 * share)} %`, '#ffffff'] : ['✓', style('stereo')];
    // The target is seen in the middle of a cell: the label keeps to its corner.
    const [labelX, labelY] = [x + width - 30 * dots, y + height - 15 * dots];
    context.lineWidth = 4 * dots;
    context.strokeStyle = '#000';
    context.strokeText(label, labelX, labelY);
    context.fillStyle = colour;
    context.fillText(label, labelX, labelY);
  }));
  context.fillStyle = isStill ? '#56b4e9' : '#e69f00';
  for (const [u, v] of corners) {
    context.beginPath();
    context.arc(left + zoom * (u + 0.5), top + zoom * (v + 0.5), 2.5 * dots, 0, 2 * Math.PI);
    context.fill();
  }
}
