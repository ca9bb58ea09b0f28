// The connection to the panel: it comes back by itself, and tells four times a second that this page is there.
const BEAT_MS = 250;
const AGAIN_MS = 1000;

// The header and what follows it: see `packed` in the panel's messages.
function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  return { ...header, buffer, at: 4 + length };
}

export function connect() {
  const listeners = new Map();
  let socket = null;
  const tell = (message) => (listeners.get(message.kind) ?? []).forEach((listener) => listener(message));
  const link = {
    you: null,
    drives: false,
    // Calls `listener` with every message of a kind; `open` and `closed` are of the connection itself.
    on(kind, listener) {
      listeners.set(kind, [...(listeners.get(kind) ?? []), listener]);
    },
    send(message) {
      if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
    },
    open() {
      const token = new URLSearchParams(location.search).get('token');
      socket = new WebSocket(`ws://${location.host}/socket${token ? `?token=${encodeURIComponent(token)}` : ''}`);
      socket.binaryType = 'arraybuffer';
      socket.onmessage = ({ data }) => tell(typeof data === 'string' ? JSON.parse(data) : unpack(data));
      socket.onopen = () => tell({ kind: 'open' });
      socket.onclose = () => {
        link.drives = false;
        tell({ kind: 'closed' });
        setTimeout(link.open, AGAIN_MS);
      };
    },
  };
  link.on('hello', ({ you }) => { link.you = you; });
  link.on('control', ({ driver }) => { link.drives = driver !== null && driver === link.you; });
  setInterval(() => link.send({ do: 'beat' }), BEAT_MS);
  return link;
}

// A canvas with as many pixels as the screen shows of it; draws anew when its size or the colour scheme changes.
export function fitted(canvas, draw) {
  const again = () => {
    const scale = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth * scale, canvas.clientHeight * scale].map(Math.round);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    if (width > 0 && height > 0) draw(scale);
  };
  let waiting = false;
  const soon = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; again(); });
  };
  new ResizeObserver(soon).observe(canvas);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', soon);
  return soon;
}
