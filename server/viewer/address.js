// Writes the current view into the address bar, without adding to the history.
const kPauseMs = 400;  // Safari throws after 100 changes in 30 s, Firefox after 200 in 10 s

export class Address {
  #timer;
  #isStale = false;

  // `fragment()`: of the current view; undefined: the address stays as it is.
  constructor(fragment) {
    this.fragment = fragment;
    addEventListener("pagehide", () => this.#isStale && this.write());
  }

  // The view has changed. The first change of many is written at once, the last one after a pause.
  follow() {
    this.#isStale = true;
    if (!this.#timer) this.write();
  }

  write() {
    clearTimeout(this.#timer);
    this.#isStale = false;
    this.#timer = setTimeout(() => {
      this.#timer = undefined;
      if (this.#isStale) this.write();
    }, kPauseMs);
    const fragment = this.fragment();
    try {
      if (fragment) history.replaceState(undefined, "", fragment);
    } catch {
      this.#isStale = true;  // the browser has had enough changes for now
    }
  }
}
