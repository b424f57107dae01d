// Talks to the server: JSON requests, and the WebSocket of the sliders with its binary messages.

export async function get(path) {
  return answered(await reached(path));
}

/** What is no text, such as a PDF or a message of maps, as an ArrayBuffer. */
export async function bytes(path) {
  const answer = await reached(path);
  return answer.ok ? answer.arrayBuffer() : answered(answer);
}

const MOST_PAUSE = 10000; // ms

/** How long to wait [ms] after so many tries in vain: who does not answer for long is asked less often. */
export const pauseAfter = (tries) => Math.min(1000 * 2 ** Math.max(tries - 1, 0), MOST_PAUSE);

/** A server that is gone is told in the words of the page; each browser has others. */
async function reached(path, asked) {
  try { return await fetch(path, asked); } catch { throw new Error("the server does not answer"); }
}

/** With `last` the request outlives the page, which its body must be short for (60 kB). */
export async function send(path, body, method = "POST", last = false) {
  return answered(await reached(path, {
    method, headers: { "content-type": "application/json" }, body: JSON.stringify(body), keepalive: last,
  }));
}

/** A file as it is: the body is its bytes. */
export async function upload(path, file, method = "POST") {
  return answered(await reached(path, { method, body: file }));
}

async function answered(response) {
  const text = await response.text();
  let found;
  try { found = JSON.parse(text); } catch { found = { message: text }; }
  if (!response.ok) throw Object.assign(new Error(found.message || `error ${response.status}`), { status: response.status, found });
  return found;
}

const KINDS = { f4: Float32Array, u2: Uint16Array, u1: Uint8Array };

/** Header and arrays of a binary message; the layout is that of flowslide/studio/frames.py. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  for (const { name, dtype, shape, offset } of header.arrays) {
    const count = shape.reduce((a, b) => a * b, 1);
    arrays[name] = new KINDS[dtype](buffer, 4 + length + offset, count);
  }
  return { header, ...arrays };
}

const PACE = 130; // ms in which a question may wait for a first answer to the one before it
/** Least time [ms] between questions: bands follow the mouse smoothly, and more of them would take the solver's time. */
const APART = 100;

/** The sliders' socket; it connects again by itself, at once where somebody comes back to the page. `on` has deposit, forecast, failed and connected. */
export class Sliders {
  constructor(on) {
    this.on = on;
    this.number = 0;
    this.shown = 0;
    this.waiting = null;
    this.tries = 0;
    this.connect();
    addEventListener("visibilitychange", () => { if (!document.hidden && this.socket.readyState === WebSocket.CLOSED) this.connect(); });
  }

  get isOpen() { return this.socket.readyState === WebSocket.OPEN; }

  connect() {
    clearTimeout(this.again);
    this.socket = new WebSocket(`ws://${location.host}/api/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.tries = 0; this.on.connected(true); this.post(); };
    this.socket.onclose = () => {
      this.tries += 1;
      this.on.connected(false);
      this.again = setTimeout(() => this.connect(), pauseAfter(this.tries));
    };
    this.socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) {
        const found = unpack(data);
        const { id } = found.header;
        this.answered(id);
        if (id <= this.shown) return;
        if (found.header.type === "forecast") { this.on.forecast(found); return; } // until the deposit itself is there
        this.shown = id;
        if (id === this.number) this.waiting = null;
        this.on.deposit(found, id === this.number);
      } else {
        const found = JSON.parse(data);
        this.answered(found.id);
        if (found.id === this.number && this.waiting) { this.waiting = null; this.on.failed(found.message); }
      }
    };
  }

  /** Ask; an answer to an earlier question is shown while this one waits for its own, unless it is older than what is shown. */
  ask(question) {
    this.number += 1;
    this.waiting = JSON.stringify({ ...question, id: this.number });
    if (!this.pacing) this.post();
    return this.number;
  }

  /** Nobody waits for an answer any more: the section is another, or at fault. */
  forget() {
    this.shown = this.number;
    this.waiting = null;
  }

  /** Send what is asked last; the next one as soon as there is a first answer, so that a drag does not keep the server busy. */
  post() {
    if (!this.isOpen || !this.waiting) return;
    clearTimeout(this.pacing);
    this.sent = this.number;
    this.sentAt = performance.now();
    this.socket.send(this.waiting);
    this.pacing = setTimeout(() => this.next(), PACE);
  }

  answered(id) {
    if (!this.pacing || id !== this.sent) return;
    clearTimeout(this.pacing);
    this.pacing = setTimeout(() => this.next(), Math.max(this.sentAt + APART - performance.now(), 0));
  }

  next() {
    this.pacing = 0;
    if (this.number !== this.sent) this.post();
  }
}
