/* The site's search from disk, where no browser starts a worker: a hidden frame does its work, by the same messages.
   The theme's plugin "offline" loads a script of this name, and puts the index of the search into a script as well. */
if (location.protocol === "file:")
  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      const { contentWindow: inside } = frame;
      inside.document.write("<body></body>");
      inside.document.close();
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      const script = inside.document.createElement("script");
      script.src = address;
      this.inside = new Promise((loaded) => (script.onload = () => loaded(inside)));
      inside.document.body.append(script);
    }
    postMessage(data) {
      this.inside.then((inside) => inside.dispatchEvent(new MessageEvent("message", { data })));
    }
  };
