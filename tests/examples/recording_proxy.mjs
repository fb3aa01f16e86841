// A proxy in front of the server that notes each request, and on demand takes from replies what caches go by.
import http from 'node:http';

// What a server would send that keeps caches worse: each has to be found out by the test that uses it.
export const kFaults = {
  'no version in URLs': (reply) => ({ ...reply, body: reply.document ? reply.body.replace(/\?v=[0-9a-f]{12}(&|(?="))/g, (_, more) => more && '?') : reply.body }),
  'no caching headers': ({ headers: { 'cache-control': _, etag: __, ...headers }, ...reply }) => ({ ...reply, headers }),
  'documents kept for an hour': (reply) =>
    reply.document ? { ...reply, headers: { ...reply.headers, 'cache-control': 'public, max-age=3600' } } : reply,
};

export async function startProxy(upstream, fault = (reply) => reply) {
  const { hostname, port } = new URL(upstream);
  const asked = [];
  const proxy = http.createServer((request, reply) => {
    // Documents are changed as text, so they must not be compressed.
    const document = /\.json(\?|$)/.test(request.url);
    const headers = { ...request.headers, ...(document && { 'accept-encoding': 'identity' }) };
    http.request({ hostname, port, method: request.method, path: request.url, headers }, (answer) => {
      const parts = [];
      answer.on('data', (part) => parts.push(part));
      answer.on('end', () => {
        asked.push({ path: request.url, status: answer.statusCode });
        const bytes = Buffer.concat(parts);
        const sent = fault({ document, headers: answer.headers, body: document ? bytes.toString() : bytes });
        const { 'transfer-encoding': _, 'content-length': __, ...kept } = sent.headers;
        reply.writeHead(answer.statusCode, answer.statusCode === 304 ? kept : { ...kept, 'content-length': Buffer.byteLength(sent.body) });
        reply.end(sent.body);
      });
    }).on('error', () => reply.destroy()).end();
  });
  await new Promise((resolve) => proxy.listen(0, '127.0.0.1', resolve));
  return {
    url: `http://127.0.0.1:${proxy.address().port}`,
    asked,
    stop: () => new Promise((resolve) => { proxy.close(resolve); proxy.closeAllConnections(); }),
  };
}
