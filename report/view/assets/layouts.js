// Layouts of scopes that the user keeps by their names, for all recordings.

import { keepLayout, layouts } from "./api.js";

const get = (id) => document.getElementById(id);
const option = (value, textContent) => Object.assign(document.createElement("option"), { value, textContent });

export class Layouts {
  #known = {};

  constructor(scopes) {
    this.scopes = scopes;
    get("layout").addEventListener("change", ({ target }) => this.#show(target.value));
    get("layout-keep").addEventListener("click", () => this.#open());
    get("layout-no").addEventListener("click", () => get("layout-dialog").close());
    get("layout-remove").addEventListener("click", () => this.#keep(null));
    get("layout-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#keep(scopes.layout());
    });
    layouts().then((known) => this.#take(known)).catch((error) => scopes.report(error.message));
  }

  #take(known, chosen = "") {
    this.#known = known;
    const names = Object.keys(known);
    get("layout").replaceChildren(option("", "Layout…"), ...names.map((name) => option(name, name)));
    get("layout").value = chosen;
    get("layout").hidden = names.length === 0;
  }

  #show(name) {
    if (name) this.scopes.take(this.#known[name]);
  }

  #open() {
    get("layout-name").value = get("layout").value;
    get("layout-answer").textContent = "";
    get("layout-remove").hidden = !get("layout").value;
    get("layout-dialog").showModal();
  }

  async #keep(plots) {
    const name = plots ? get("layout-name").value.trim() : get("layout").value;
    try {
      this.#take(await keepLayout(name, plots), plots ? name : "");
      get("layout-dialog").close();
    } catch (error) {
      get("layout-answer").textContent = error.message;
    }
  }
}
