// The socket: messages out, pictures and state in; it is opened again when it breaks.
const decoder = new TextDecoder();

export class Link {
  constructor(on) {
    this.on = on;
    this.tries = 0;
    this.pending = new Map(); // gathered until the next animation frame, by key
    this.open();
  }

  open() {
    const url = new URL("live", location.href.split(/[?#]/)[0]);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    this.socket = new WebSocket(url);
    this.socket.binaryType = "arraybuffer";
    this.shown = 0;
    this.socket.onopen = () => { this.tries = 0; this.on.open(); };
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = (event) => {
      const forGood = event.code === 1008 || event.code === 1013;
      this.on.close(event.reason || "not connected: ispm may have ended", forGood);
      if (!forGood) setTimeout(() => this.open(), Math.min(500 * 2 ** this.tries++, 8000));
    };
  }

  put(text) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text);
  }

  // Files: what the scene is saved as, the picture, one that is dropped; as the browser's own `fetch`.
  fetch(what, how) { return fetch(what, how); }

  send(message) { this.put(JSON.stringify(message)); }

  // Send with the next animation frame; `merge` joins what has the same key.
  soon(key, message, merge = (_, next) => next) {
    if (!this.pending.size) requestAnimationFrame(() => this.flush());
    this.pending.set(key, this.pending.has(key) ? merge(this.pending.get(key), message) : message);
  }

  flush() {
    for (const message of this.pending.values()) this.send(message);
    this.pending.clear();
  }

  async receive(data) {
    if (typeof data === "string") {
      const { part, value } = JSON.parse(data);
      this.on.part(part, value);
      return;
    }
    const length = new DataView(data).getUint32(0, true);
    const about = JSON.parse(decoder.decode(new Uint8Array(data, 4, length)));
    const picture = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)], { type: about.kind }));
    if (about.number > this.shown) {
      this.shown = about.number;
      this.on.picture(about, picture);
    } else picture.close(); // a newer one was decoded sooner
    this.send({ type: "ack", number: about.number });
  }
}
