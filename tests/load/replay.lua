-- wrk script: sends the requests of the file in WALK in a loop, in its order. Each thread starts at a different
-- request. At the end it prints one line of JSON to stdout.
local paths = {}
for line in io.lines(os.getenv("WALK")) do
  paths[#paths + 1] = line
end

local threads = 0
function setup(thread)
  thread:set("number", threads)
  threads = threads + 1
end

local at = 0
function init(args)
  math.randomseed(tonumber(number) + 1)
  at = number == 0 and 0 or math.random(#paths)
end

function request()
  at = at % #paths + 1
  return wrk.format("GET", paths[at], {["Accept-Encoding"] = "gzip"})
end

function done(summary, latency, requests)
  local errors = summary.errors
  io.write(string.format(
    '{"requests": %d, "seconds": %.6f, "bytes": %d, "p50_ms": %.3f, "p99_ms": %.3f, "errors": %d}\n',
    summary.requests, summary.duration / 1e6, summary.bytes, latency:percentile(50) / 1e3, latency:percentile(99) / 1e3,
    errors.status + errors.connect + errors.read + errors.write + errors.timeout))
end
