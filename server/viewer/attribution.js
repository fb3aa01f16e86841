// Attributions are text or HTML, for clients that show them as HTML. The page shows their text.
export const textOf = (attribution) => new DOMParser().parseFromString(attribution ?? "", "text/html").body.textContent;
