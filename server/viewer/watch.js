// Asks the server again and again what it has, so that the page follows restarts and new versions without a reload.
const kCalmMs = 5000;
const kHastyMs = 1500;
const kFirstRetryMs = 500;
const kLastRetryMs = 5000;

export class Watch {
  #timer;
  #retryMs = kFirstRetryMs;
  #running = false;
  #error;  // the class of the last one

  // `list`: fetches the datasets, throws if that fails. `onLost(error)`: it failed, for the first time or
  // with another kind of error. `onList(wasLost)`: it succeeded. `isHasty`: something is about to appear.
  constructor({ list, onLost, onList }) {
    Object.assign(this, { list, onLost, onList, isLost: false, isHasty: false });
  }

  start() {
    document.addEventListener("visibilitychange", () => document.hidden || this.check());
    this.#wait(this.isHasty ? kHastyMs : kCalmMs);
  }

  // Asks now; a tile has failed, for example.
  async check() {
    if (this.#running) return;
    this.#running = true;
    clearTimeout(this.#timer);
    try {
      await this.list();
      const wasLost = this.isLost;
      this.isLost = false;
      this.#retryMs = kFirstRetryMs;
      this.onList(wasLost);  // what it starts may wait for replies; the next list does not
    } catch (error) {
      if (!this.isLost || error.constructor !== this.#error) this.onLost(error);
      this.isLost = true;
      this.#error = error.constructor;
      this.#retryMs = Math.min(kLastRetryMs, 1.5 * this.#retryMs);
    } finally {
      this.#running = false;
      this.#wait(this.isLost ? this.#retryMs : this.isHasty ? kHastyMs : kCalmMs);
    }
  }

  #wait(milliseconds) {
    this.#timer = setTimeout(() => (document.hidden ? this.#wait(kCalmMs) : this.check()), milliseconds);
  }
}
