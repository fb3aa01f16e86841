// Of overlapping runs of one action only the latest counts.
export class Turns {
  #latest = 0;

  // Begins a run. Returns a function that tells whether this run is still the latest; a run asks it after each wait.
  begin() {
    const turn = ++this.#latest;
    return () => turn === this.#latest;
  }
}
