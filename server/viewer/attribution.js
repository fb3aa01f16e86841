// Attributions are text or HTML, for clients that show them as HTML. The page shows their text, those that there are on one
// line.
export const textOf = (...attributions) =>
  attributions.map((html) => new DOMParser().parseFromString(html ?? "", "text/html").body.textContent).filter(Boolean).join(" · ");
