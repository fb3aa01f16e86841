// Asks for a token, in front of the globe.
const byId = (id) => document.getElementById(id);

export class TokenCard {
  // `use(token)`; `decline()`: called without one.
  constructor(use, decline) {
    byId("token-card").addEventListener("submit", (event) => {
      event.preventDefault();
      use(byId("token").value.trim());
    });
    byId("token-cancel").addEventListener("click", () => {
      this.close();
      decline();
    });
  }

  // `reason`: a sentence. `isOptional`: there are datasets that need no token.
  ask(reason, isOptional) {
    byId("token-reason").textContent = reason;
    byId("token-cancel").hidden = !isOptional;
    byId("token-card").hidden = false;
    byId("token").select();
    byId("token").focus();
  }

  close() {
    if (byId("token-card").contains(document.activeElement)) byId("dataset").focus();
    byId("token").value = "";
    byId("token-card").hidden = true;
  }
}
