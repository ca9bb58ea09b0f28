// A recording in the place of a rig: where it stands, hold and go on, and play from elsewhere. Nothing can be driven.
const byId = (id) => document.getElementById(id);

export function showPlayback(link) {
  let [isRecording, state, waiting] = [false, 'plays', 0];
  // The slider follows the recording unless somebody holds it.
  let held = false;
  const toggle = () => {
    if (state === 'over') link.send({ do: 'jump', to_s: 0 });
    else link.send({ do: state === 'paused' ? 'resume' : 'pause' });
  };
  byId('hold').addEventListener('click', toggle);
  // The space bar, which stops a rig, holds a recording: before anything else that it would do.
  for (const event of ['keydown', 'keyup']) {
    addEventListener(event, (pressed) => {
      if (!isRecording || pressed.code !== 'Space') return;
      pressed.preventDefault();
      pressed.stopImmediatePropagation();
      if (event === 'keydown' && !pressed.repeat) toggle();
    }, { capture: true });
  }
  const slider = byId('place');
  slider.addEventListener('input', () => { held = true; });
  slider.addEventListener('change', () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      held = false;
      link.send({ do: 'jump', to_s: Number(slider.value) });
    }, 250);
  });
  link.on('hello', ({ recorded_ms: recorded }) => {
    isRecording = recorded !== null;
    document.body.classList.toggle('replays', isRecording);
    byId('playback').hidden = !isRecording;
    if (!isRecording) return;
    const date = new Date(recorded).toLocaleString(undefined, { dateStyle: 'long', timeStyle: 'short' });
    byId('recorded').textContent = `A recording of ${date}.`;
    byId('who').textContent = 'a recording: nothing can be driven';
  });
  link.on('playback', ({ at_s: at, length_s: length, rate, state: now }) => {
    state = now;
    byId('hold').textContent = { plays: 'Hold', paused: 'Go on', over: 'Play again' }[state];
    slider.disabled = length === null;
    slider.max = length ?? Math.max(at, Number(slider.max));
    if (!held) slider.value = at;
    const of = length === null ? ' (its end is missing)' : ` of ${length.toFixed(1)} s`;
    const pace = rate === null || rate === 1 ? '' : `, ${rate} times as fast`;
    byId('played').textContent = `${at.toFixed(1)} s${of}${pace}${state === 'plays' ? '' : `; ${state}`}`;
    slider.setAttribute('aria-valuetext', `${at.toFixed(1)} seconds`);
  });
}
