// The documents of the case that is open: edits, undo and redo, and saving by itself.

import { get, pauseAfter, send } from "./api.js";
import { followSection } from "./water.js";

const PARTS = ["scene", "measurements", "inversion", "diagnosis", "blow_counts", "tables"];
const DEPTH = 200; // edits that can be undone
const PAUSE = 200; // ms after the last edit until it is saved
const KEPT = 30; // edits that can be undone after a reload
const SHORT = 60000; // characters that can still be sent while the page is left
export const CHOOSE = "this case was changed elsewhere while you edited it: choose which to keep first";
const LOOK = 3000; // ms between two looks whether the files were changed elsewhere

const partsOf = (found) => Object.fromEntries(PARTS.map((part) => [part, structuredClone(found[part] ?? null)]));

/** `on` has changed(words, whether the section is another), stepped(parts) after an undo or redo, same() after an edit that changed nothing, saved(case), conflict(case), failed(words) and unread(words): the files cannot be read, or with "" can be again. */
export class Documents {
  constructor(on) {
    this.on = on;
    this.name = "";
    setInterval(() => this.look(), LOOK);
    addEventListener("visibilitychange", () => { if (document.hidden) this.save(); });
    addEventListener("beforeunload", (event) => this.leave(event));
  }

  /** The page is left: a number that is being typed counts, and what cannot be sent any more is asked about. */
  leave(event) {
    document.activeElement?.blur();
    if (!this.dirty && !this.saving) return;
    if (this.saving || this.apart || this.failing || JSON.stringify(this.now).length > SHORT) event.preventDefault();
    else this.save(true);
  }

  open(found) {
    clearTimeout(this.waiting);
    Object.assign(this, { name: found.name, shipped: found.shipped, revision: found.revision, now: partsOf(found),
      past: [], future: [], dirty: false, apart: false, failing: "", tries: 0, answer: "", unread: "" });
    const kept = JSON.parse(sessionStorage.getItem(`edits of ${found.name}`));
    if (kept?.revision === found.revision) Object.assign(this, { past: kept.past, future: kept.future });
  }

  /** For a reload of the page, as far as the browser has room. */
  keepEdits() {
    const { name, revision } = this;
    try {
      sessionStorage.setItem(`edits of ${name}`, JSON.stringify({ revision, past: this.past.slice(-KEPT), future: this.future.slice(-KEPT) }));
    } catch { sessionStorage.removeItem(`edits of ${name}`); }
  }

  /** The server's word on the documents of now is still to come. */
  get pending() { return this.dirty || this.saving; }

  /** A style or a test sees that a save is to come, or on its way. */
  mark() { document.body.toggleAttribute("data-saving", this.pending && !this.apart && !this.failing); }

  get canUndo() { return this.past?.length > 0; }
  get canRedo() { return this.future?.length > 0; }

  /** Change the documents: `change` gets a copy that it may write on. `answer`: a job whose answer is kept by that, and nothing else. */
  edit(words, change, answer = "") {
    if (this.shipped) { this.on.failed("this case ships with flowslide: copy it to edit it"); return; }
    const before = this.now;
    const next = structuredClone(before);
    change(next);
    followSection(before.scene, next.scene);
    // "8.0" in place of 8 is no edit that anybody would undo.
    if (JSON.stringify(next) === JSON.stringify(before)) { this.on.same(); return; }
    this.past.push({ words, documents: before });
    if (this.past.length > DEPTH) this.past.shift();
    this.future = [];
    this.take(next, words, this.pending ? "" : answer);
  }

  /** Several edits are undone as one. */
  together(words, act) {
    const [before, last] = [this.now, this.past.at(-1)];
    act();
    if (this.now !== before) this.past.splice(this.past.indexOf(last) + 1, Infinity, { words, documents: before });
  }

  /** A change that belongs to the edit before it: both are undone together. */
  amend(words, change) {
    const next = structuredClone(this.now);
    change(next);
    this.take(next, words);
  }

  undo() { this.step(this.past, this.future, "undone"); }
  redo() { this.step(this.future, this.past, "done again"); }

  step(from, to, done) {
    const last = from?.pop();
    if (!last) return;
    const before = this.now;
    to.push({ words: last.words, documents: before });
    this.take(last.documents, `${last.words}: ${done}`);
    this.on.stepped(PARTS.filter((part) => JSON.stringify(before[part]) !== JSON.stringify(this.now[part])));
  }

  take(documents, words, answer = "") {
    this.answer = answer;
    const isOther = JSON.stringify(documents.scene) !== JSON.stringify(this.now.scene);
    this.now = documents;
    this.dirty = true;
    this.mark();
    this.on.changed(words, isOther);
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.save(), PAUSE);
  }

  /** One save at a time; an edit that comes meanwhile is saved after it. */
  async save(last = false) {
    if (!this.dirty || this.saving || this.apart) return;
    clearTimeout(this.waiting);
    this.saving = true;
    this.dirty = false;
    const { name, answer } = this;
    try {
      const found = await send(`/api/cases/${name}`, { revision: this.revision, answer, ...this.now }, "PUT", last);
      if (name !== this.name) return;
      Object.assign(this, { revision: found.revision, failing: "", tries: 0 });
      this.tellUnread("");
      // What the program has added, such as room for the slide; it is no edit of its own.
      if (!this.dirty) this.now = partsOf(found);
      this.keepEdits();
      this.saving = false;
      this.on.saved(found);
    } catch (error) {
      if (name !== this.name) return;
      this.dirty = true;
      if (error.status === 409) { Object.assign(this, { apart: true, unread: "" }); this.on.conflict(error.found.case); }
      else {
        // A disk that is full may have taken a part of it, which is no edit of anybody else.
        this.revision = error.found?.revision ?? this.revision;
        this.failing = `not saved: ${error.message}`;
        this.tries += 1;
        this.on.failed(this.failing);
      }
    } finally {
      this.saving = false;
      if (this.dirty && !this.apart && name === this.name) this.waiting = setTimeout(() => this.save(), this.failing ? pauseAfter(this.tries) : PAUSE);
      this.mark();
    }
  }

  /** Wait until all is saved, before another case is opened; what is in the way of it, in words: somebody must choose first, or it cannot be saved. */
  async flush() {
    this.failing = "";
    while ((this.dirty || this.saving) && !this.apart && !this.failing && this.name) {
      await this.save();
      await new Promise((go) => { setTimeout(go, 30); });
    }
    return this.apart ? CHOOSE : this.failing;
  }

  /** After a conflict: keep this page's documents, over those of the files. */
  insist(found) {
    Object.assign(this, { revision: found.revision, apart: false, dirty: true });
    this.save();
  }

  /** A draft whose files somebody has changed is not saved before it is said which of both counts. */
  hold() { this.apart = true; }

  /** What the files say, in place of the draft; it can be undone. */
  drop(files) {
    this.apart = false;
    this.edit("what the files say", (now) => Object.assign(now, partsOf(files)));
  }

  /** Another tab, the command line or an editor has written to the files. */
  async look() {
    if (!this.name || document.hidden || this.dirty || this.saving || this.apart) return;
    const { name, revision } = this;
    const isSame = () => name === this.name && revision === this.revision && !this.pending;
    try {
      const { revision: there } = await get(`/api/cases/${name}/revision`);
      if (!isSame()) return;
      this.tellUnread("");
      if (there !== revision) this.on.elsewhere();
    } catch (error) {
      if (error.status === 400 && isSame()) this.tellUnread(error.message); // a server that is gone is told elsewhere
    }
  }

  /** Files that are half written, or gone: told once, and once more when they are there again. */
  tellUnread(words) {
    if (words === this.unread) return;
    this.unread = words;
    this.on.unread(words);
  }
}
