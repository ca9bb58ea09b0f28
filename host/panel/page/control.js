// Who drives, the modes, home, clear, and the stop, which every page has.
const byId = (id) => document.getElementById(id);

export function showControl(link) {
  let control = { driver: null, asking: [], pages: 0 };
  let modes = [];
  let isRecording = false;
  const stop = () => link.send({ do: 'stop' });
  byId('stop').addEventListener('click', stop);
  // Before anything else that the space bar would do. A key that is held repeats, and one stop is enough.
  for (const event of ['keydown', 'keyup']) {
    addEventListener(event, (pressed) => {
      if (pressed.code !== 'Space') return;
      pressed.preventDefault();
      pressed.stopImmediatePropagation();
      if (event === 'keydown' && !pressed.repeat) stop();
    }, { capture: true });
  }
  byId('home').addEventListener('click', () => link.send({ do: 'home' }));
  byId('clear').addEventListener('click', () => link.send({ do: 'clear' }));
  byId('take').addEventListener('click', () => link.send({ do: link.drives ? 'hand_over' : 'take' }));

  const update = () => {
    for (const button of document.querySelectorAll('#modes button, #home, #clear')) {
      button.disabled = !link.drives;
      button.title = isRecording ? 'this is a recording: nothing can be driven' : link.drives ? '' : 'take control first';
    }
    if (isRecording) return;
    const { driver, asking, pages } = control;
    const asked = asking.includes(link.you);
    const who = link.drives ? 'you drive' : driver === null ? 'nobody drives' : `page ${driver} drives, you watch`;
    byId('who').textContent = `${who} (${pages} open)`;
    byId('who').classList.toggle('good', link.drives);
    const take = byId('take');
    take.textContent = link.drives
      ? (asking.length ? `Hand over to page ${asking[0]}` : 'Give up control')
      : asked ? 'Asked for control' : driver === null ? 'Take control' : 'Ask for control';
    take.disabled = asked;
    take.classList.toggle('asked', link.drives && asking.length > 0);
  };
  link.on('hello', (hello) => {
    modes = hello.modes;
    isRecording = hello.recorded_ms !== null;
    byId('modes').replaceChildren(...modes.map(({ name }) => {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = name;
      button.setAttribute('aria-pressed', 'false');
      button.addEventListener('click', () => link.send({ do: 'mode', name }));
      return button;
    }));
    update();
  });
  link.on('control', (message) => { control = message; update(); });
  link.on('closed', () => { control = { driver: null, asking: [], pages: 0 }; update(); });
  link.on('status', ({ mode, doing }) => {
    byId('doing').textContent = doing ? `under way: ${doing}` : '';
    for (const button of byId('modes').children) {
      button.setAttribute('aria-pressed', String(button.textContent === mode));
    }
  });
}
