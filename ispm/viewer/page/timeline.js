// The time line at the foot, where the scene has animations.
const $ = (id) => document.getElementById(id);

export class TimeLine {
  constructor(link) {
    this.link = link;
    this.value = null;
    this.scrubbing = false;
    $("play").addEventListener("click", () => this.toggle());
    $("scrub").addEventListener("input", () => {
      this.scrubbing = true;
      link.soon("scrub", { type: "play", time: Number($("scrub").value), playing: false });
    });
    $("scrub").addEventListener("change", () => { this.scrubbing = false; });
    $("speed").addEventListener("change", () => link.send({ type: "play", speed: Number($("speed").value) }));
    $("animation").addEventListener("change", () => link.send({ type: "play", animation: $("animation").value }));
  }

  toggle() {
    if (this.value && this.value.animations.length) this.link.send({ type: "play", playing: !this.value.playing });
  }

  show(value) {
    this.value = value;
    $("timeline").hidden = !value.animations.length;
    $("play").textContent = value.playing ? "❚❚" : "▶";
    $("scrub").max = value.duration;
    if ([...$("speed").options].some((o) => Number(o.value) === value.speed)) $("speed").value = String(value.speed);
    const names = ["", ...value.animations.map((a) => a[0])];
    if ($("animation").childElementCount !== names.length) {
      $("animation").replaceChildren(...names.map((name) => new Option(name || "all", name)));
    }
    $("animation").value = value.animation;
    $("animation").hidden = names.length < 3;
  }

  at(time) {
    $("clock").textContent = `${time.toFixed(2)} s`;
    if (!this.scrubbing) $("scrub").value = time;
  }
}
