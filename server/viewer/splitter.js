// The line between the two parts of the view, moved by pointer or arrow keys.
const kKeyStep = 0.02;
const kKeys = { ArrowLeft: -kKeyStep, ArrowRight: kKeyStep };

export class Splitter {
  // `onMove` gets the position of the line as a fraction of the width, from the left.
  constructor(element, onMove) {
    Object.assign(this, { element, onMove });
    element.addEventListener("pointerdown", (event) => element.setPointerCapture(event.pointerId));
    element.addEventListener("pointermove", (event) => {
      if (element.hasPointerCapture(event.pointerId)) this.#move(event.clientX / innerWidth);
    });
    element.addEventListener("keydown", (event) => {
      if (!(event.key in kKeys) || event.ctrlKey || event.metaKey || event.altKey) return;
      this.#move(this.place + kKeys[event.key]);
      event.preventDefault();
    });
  }

  get place() {
    return Number(this.element.getAttribute("aria-valuenow")) / 100;
  }

  set place(share) {
    this.element.style.left = `${100 * share}%`;
    this.element.setAttribute("aria-valuenow", Math.round(100 * share));
  }

  #move(share) {
    this.place = Math.min(1, Math.max(0, share));
    this.onMove(this.place);
  }
}
