// The link of a page that is a frame in a notebook: what the socket carries goes through the notebook's widget.
import { Link as Socket } from "./link.js";

export class Link extends Socket {
  open() {
    this.answers = new Map();
    this.asked = this.shown = 0;
    addEventListener("message", (event) => { if (event.source === parent) this.hear(event.data); });
    setTimeout(() => { parent.postMessage({ what: "open" }, "*"); this.on.open(); });
  }

  put(text) { parent.postMessage({ what: "message", text }, "*"); }

  async fetch(name, how = {}) {
    const body = how.body ? await how.body.arrayBuffer() : null, number = ++this.asked;
    const answer = new Promise((resolve) => this.answers.set(number, resolve));
    parent.postMessage({ what: "file", name, number, body }, "*");
    return answer;
  }

  hear({ number, status, text, data }) {
    if (status) {
      this.answers.get(number)?.(new Response(status === 204 ? null : data, { status }));
      this.answers.delete(number);
    } else if (text) this.receive(text);
    else if (data) this.receive(data);
    else this.on.close("this view is closed", true);
  }
}
