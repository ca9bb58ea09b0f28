// What happened, newest first.
export function showLog(link) {
  const list = document.getElementById('log');
  let shown = 0;
  link.on('hello', () => { shown = 0; list.replaceChildren(); });
  link.on('log', ({ lines }) => {
    for (const { number, source, seconds, level, text } of lines) {
      if (number <= shown) continue;
      shown = number;
      const item = document.createElement('li');
      const time = document.createElement('time');
      time.textContent = `${source} ${seconds.toFixed(1)} s`;
      const words = document.createElement('span');
      words.className = level;
      words.textContent = level === 'note' ? text : `${level}: ${text}`;
      item.append(time, words);
      list.prepend(item);
    }
    while (list.children.length > 200) list.lastChild.remove();
  });
}
