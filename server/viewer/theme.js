// Light or dark: as the system says until the button is used; the choice is kept in this browser.
const kKey = "terrace.theme";
const kLight = matchMedia("(prefers-color-scheme: light)");
const listeners = [];

// A browser may forbid pages to store data.
function stored(act) {
  try {
    return act(localStorage);
  } catch {
    return undefined;
  }
}

export const isLight = () => document.documentElement.dataset.theme === "light";

// Calls back now and after each change, with whether the theme is light.
export function onTheme(callback) {
  listeners.push(callback);
  callback(isLight());
}

function set(theme) {
  document.documentElement.dataset.theme = theme;
  listeners.forEach((callback) => callback(isLight()));
}

export function startTheme() {
  const chosen = stored((storage) => storage.getItem(kKey));
  set(chosen ?? (kLight.matches ? "light" : "dark"));
  kLight.addEventListener("change", () => stored((storage) => storage.getItem(kKey)) ?? set(kLight.matches ? "light" : "dark"));
  document.getElementById("theme").addEventListener("click", () => {
    set(isLight() ? "dark" : "light");
    stored((storage) => storage.setItem(kKey, document.documentElement.dataset.theme));
  });
}
