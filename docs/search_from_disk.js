// Search in a site that is opened from the disk. Browsers start no worker from file://, so an
// iframe takes its place. `IFrameWorker` is the name by which the theme's search recognises it.
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      this.room = frame.contentWindow;
      this.room.document.open();
      this.room.document.write("<body></body>");
      this.room.document.close();
      this.room.postMessage = (data) =>
        setTimeout(() => this.dispatchEvent(new MessageEvent("message", { data })));
      this.room.importScripts = (...urls) =>
        urls.reduce((last, each) => last.then(() => this.load(each)), Promise.resolve());
      this.started = this.load(new URL(url, location));
    }

    load(source) {
      return new Promise((done, failed) => {
        const script = this.room.document.createElement("script");
        script.src = source;
        script.onload = done;
        script.onerror = failed;
        this.room.document.body.append(script);
      });
    }

    postMessage(data) {
      const message = new MessageEvent("message", { data });
      this.started.then(() => this.room.dispatchEvent(message));
    }
  };
  window.Worker = window.IFrameWorker;
}
