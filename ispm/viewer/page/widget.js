// What a notebook runs: a frame with the page, and what goes between it and Python. PAGE is put before this.
export default {
  render({ model, el }) {
    const frame = document.createElement("iframe"), view = `${Math.random()}`.slice(2);
    frame.srcdoc = PAGE;
    frame.title = "ispm";
    frame.style.cssText = `display: block; width: 100%; height: ${model.get("height")}px; border: 0; border-radius: 8px;`;
    const out = (event) => {
      if (event.source !== frame.contentWindow) return;
      const { body, ...content } = event.data;
      model.send({ ...content, view }, undefined, body ? [body] : []);
    };
    const into = (content, buffers) => {
      if (content.view !== view) return;
      const data = buffers.length ? new Uint8Array(buffers[0].buffer ?? buffers[0], buffers[0].byteOffset ?? 0, buffers[0].byteLength).slice().buffer : null;
      frame.contentWindow?.postMessage({ ...content, data }, "*");
    };
    addEventListener("message", out);
    model.on("msg:custom", into);
    el.append(frame);
    return () => {
      model.send({ what: "close", view });
      removeEventListener("message", out);
      model.off("msg:custom", into);
    };
  },
};
