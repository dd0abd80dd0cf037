// The dialog that chooses the fields of a plot. All names are texts of the recording: they are set as text alone.

const SHOWN_MAX = 400;

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export class Picker {
  constructor(recordings) {
    this.recordings = recordings;
    this.dialog = document.getElementById("picker");
    this.search = document.getElementById("picker-search");
    this.list = document.getElementById("picker-list");
    this.more = document.getElementById("picker-more");
    this.search.addEventListener("input", () => this.#fill());
    document.getElementById("picker-remove").addEventListener("click", () => {
      this.chosen.length = 0;
      this.dialog.close();
    });
    this.dialog.addEventListener("close", () => this.changed(this.chosen));
  }

  /** Opens it with the fields that are `chosen`; `changed` hears them when it closes. */
  open(chosen, changed) {
    Object.assign(this, { chosen: [...chosen], changed });
    this.search.value = "";
    this.#fill();
    this.dialog.showModal();
    this.search.focus();
  }

  #fill() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const parts = [];
    let [shown, left] = [0, 0];
    this.recordings.forEach((recording, number) => {
      for (const topic of recording.topics) {
        const fits = topic.fields.filter(({ path }) => words.every((word) => `${topic.name} ${path}`.toLowerCase().includes(word)));
        const listed = fits.slice(0, Math.max(SHOWN_MAX - shown, 0));
        [shown, left] = [shown + listed.length, left + fits.length - listed.length];
        if (listed.length === 0) continue;
        const ghost = number > 0 ? ` of ${recording.name}` : "";
        parts.push(element("h3", {}, topic.name + ghost, " ", element("small", { textContent: topic.type })));
        for (const field of listed) parts.push(this.#choice(number, topic.name, field));
      }
    });
    this.list.replaceChildren(...parts);
    this.more.hidden = left === 0 && shown > 0;
    this.more.textContent = shown > 0 ? `${left} more fields: search for them.` : "No field has all of these words in its name or topic.";
  }

  #choice(recording, topic, { path, unit }) {
    const is = (other) => other.recording === recording && other.topic === topic && other.field === path;
    const box = element("input", { type: "checkbox", checked: this.chosen.some(is) });
    box.addEventListener("change", () => {
      this.chosen = box.checked ? [...this.chosen, { recording, topic, field: path }] : this.chosen.filter((other) => !is(other));
    });
    return element("label", {}, box, unit ? `${path} [${unit}]` : path);
  }
}
