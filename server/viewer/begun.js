// Requests that begin before the code that reads their replies is loaded.
const begun = new Map();  // absolute URL: promise of a Response
const absolute = (url) => new URL(url, location.href).href;

export function begin(url, headers, signal) {
  const reply = fetch(url, { headers, signal });
  reply.catch(() => {});  // who takes it hears of it
  begun.set(absolute(url), reply);
  return reply.then((response) => response.clone());
}

// The promise of the Response to a request that has begun, once; undefined: there is none.
export function take(url) {
  const reply = begun.get(absolute(url));
  begun.delete(absolute(url));
  return reply;
}
