// Checks manifests against the schemas of their kinds: node kubernetes_schemas.mjs < manifests.json
// Reads a list of manifests; prints a line for each that does not fit. The schemas allow unknown keys, as those of
// Kubernetes do, so keys must also be names that some type of Kubernetes has.
import { readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const FREE = new Set(["labels", "annotations", "matchLabels", "data", "requests", "limits"]); // keys below are the user's
const folder = dirname(fileURLToPath(import.meta.resolve("kubernetes-models")));
const known = new Set(["apiVersion", "kind"]);
for (const base of [folder, join(folder, "../@kubernetes-models/apimachinery")]) {
  for (const file of readdirSync(base, { recursive: true }).filter((name) => name.endsWith(".d.ts"))) {
    for (const [, name] of readFileSync(join(base, file), "utf8").matchAll(/"?(\w+)"?\??:/g)) known.add(name);
  }
}

function unknownKeys(value, path = "") {
  if (typeof value !== "object" || value === null) return [];
  if (Array.isArray(value)) return value.flatMap((item, i) => unknownKeys(item, `${path}[${i}]`));
  return Object.entries(value).flatMap(([key, item]) => [
    ...(known.has(key) || key.includes("/") ? [] : [`${path}.${key}`]), ...(FREE.has(key) ? [] : unknownKeys(item, `${path}.${key}`))]);
}

let wrong = 0;
for (const manifest of JSON.parse(readFileSync(0, "utf8"))) {
  try {
    const module = await import(`kubernetes-models/${manifest.apiVersion}`);
    new module[manifest.kind](manifest).validate();
    const keys = unknownKeys(manifest);
    if (keys.length > 0) throw new Error(`unknown keys: ${keys.join(", ")}`);
  } catch (error) {
    console.log(`${manifest.apiVersion} ${manifest.kind} ${manifest.metadata?.name}: ${error.message}`);
    wrong += 1;
  }
}
process.exit(wrong > 0 ? 1 : 0);
