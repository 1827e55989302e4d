// Search for a site that is read from disk. Browsers start no Worker from a file, so this one runs
// the search script in a hidden frame. It replaces the script of the same name that the theme would
// load from the network; the theme looks for the class name. Pages from a server do not use it.
"use strict";

class IFrameWorker extends EventTarget {
  constructor(url) {
    super();
    this.waiting = [];
    const frame = document.createElement("iframe");
    frame.hidden = true;
    document.body.append(frame);
    this.scope = frame.contentWindow;
    this.scope.postMessage = (data) => this.deliver(this, data);
    const script = this.scope.document.createElement("script");
    script.src = url;
    script.onload = () => {
      const waiting = this.waiting;
      this.waiting = null;
      waiting.forEach((data) => this.postMessage(data));
    };
    this.scope.document.body.append(script);
  }

  postMessage(data) {
    if (this.waiting) this.waiting.push(data);
    else this.deliver(this.scope, data);
  }

  deliver(target, data) {
    setTimeout(() => target.dispatchEvent(new MessageEvent("message", { data })));
  }
}

if (location.protocol === "file:") {
  window.IFrameWorker = window.Worker = IFrameWorker;
}
