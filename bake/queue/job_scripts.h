// The state of a job in Redis, and the scripts that change it. Redis runs a script as a whole, so that a killed worker
// never leaves half of a change.
//
//   terrace:{JOB}:job     hash: what is baked (fields of JobIdentity), incarnation, state, lease_ms, units
//   terrace:{JOB}:units   stream with the consumer group "bakers": the units that are not done, field "unit"
//   terrace:{JOB}:dead    stream: the units that were given up: unit, why, deliveries, worker
//   terrace:{JOB}:taken   hash: unit -> "id worker milliseconds", by Redis's clock; for people
//   terrace:{JOB}:done    stream: the last units that were done: unit, worker, seconds; for people
//   terrace:{JOB}:errors  hash: unit -> why it failed last
//   terrace:{JOB}:failed  hash: "unit worker" -> when it failed there last
//   terrace:{JOB}:workers hash: worker -> when it was heard of last
//
// Times are milliseconds of Redis's clock. The keys that are for people, and the last three, are accessed by pcall,
// because they may hold a value of another type. A unit that is done is acknowledged and deleted from the stream. The
// braces keep the keys on one node of a cluster. The incarnation is a random number that is made whenever the queue is
// filled. A worker that took its unit from an earlier filling must not acknowledge it in a later one.
#pragma once

namespace terrace::bake::scripts {

// The last unit: writing the manifest.
inline constexpr const char* kFinishUnit = "*finish";
// The consumer that holds units until they are handed out again.
inline constexpr const char* kNobody = "-";

// Before each of the others. KEYS: as above. ARGV[1]: the incarnation; empty: there is no job. Redis 6.2 needs
// replicate_commands for scripts that ask the time and then write.
inline constexpr const char* kPrelude = R"lua(
local job, units, dead, taken, done, errors, failed, workers = unpack(KEYS)
if redis.replicate_commands then redis.replicate_commands() end
if (redis.call('HGET', job, 'incarnation') or '') ~= ARGV[1] then return {'gone'} end
local function now_ms()
  local time = redis.call('TIME')
  return time[1] .. string.format('%03d', math.floor(time[2] / 1000))
end
local function remove(id, name)
  local noted = redis.pcall('HGET', taken, name)
  if type(noted) == 'string' and string.sub(noted, 1, #id + 1) == id .. ' ' then redis.call('HDEL', taken, name) end
  local acked = redis.call('XACK', units, 'bakers', id)
  redis.call('XDEL', units, id)
  return acked == 1
end
)lua";

// ARGV: incarnation, number of fields, fields and values, units. A Redis that is full refuses only the first write of a
// script, and never DEL.
inline constexpr const char* kFill = R"lua(
redis.call('HSET', job, 'state', 'filling')
redis.call('DEL', unpack(KEYS))
local fields = tonumber(ARGV[2])
for i = 1, fields do redis.call('HSET', job, ARGV[1 + 2 * i], ARGV[2 + 2 * i]) end
redis.call('XGROUP', 'CREATE', units, 'bakers', '0', 'MKSTREAM')
for i = 3 + 2 * fields, #ARGV do redis.call('XADD', units, '*', 'unit', ARGV[i]) end
return {'ok'}
)lua";

// ARGV: incarnation, units. If the job ended incomplete, hands out again the units that were given up.
inline constexpr const char* kRevive = R"lua(
if redis.call('XLEN', units) > 0 or redis.call('XLEN', dead) == 0 then return {'ok'} end
for i = 2, #ARGV do redis.call('XADD', units, '*', 'unit', ARGV[i]) end
redis.call('DEL', dead, errors, failed)
return {'ok'}
)lua";

// ARGV: incarnation, worker, lease in ms, number of attempts. Hands out new units first, then units whose worker was
// silent for a lease, last the finishing unit. Idle times are Redis's, so that the clocks of the workers do not matter.
// Returns the number of deliveries of the unit, and whether other workers were heard of within a lease.
//
// A unit is given up because of itself, not because of a worker without room or sources. Therefore, while there is
// another worker at which it has not failed, it comes to those at which it has failed only after a lease; and no
// attempt counts as the last one while there is a worker at which it has not failed. Units that kill their workers are
// given up all the same.
inline constexpr const char* kTake = R"lua(
local worker, lease, attempts = ARGV[2], tonumber(ARGV[3]), tonumber(ARGV[4])
local now = now_ms()
redis.pcall('HSET', workers, worker, now)
local function is_recent(time) return math.abs(tonumber(now) - (tonumber(time) or 0)) < lease end
local others = {}
local heard = redis.pcall('HGETALL', workers)
for i = 1, #heard, 2 do
  if heard[i] ~= worker and is_recent(heard[i + 1]) then others[#others + 1] = heard[i] end
end
local function name_of(message)
  for i = 1, #message[2], 2 do
    if message[2][i] == 'unit' then return message[2][i + 1] end
  end
  return ''
end
local function failure(name, at)
  local time = redis.pcall('HGET', failed, name .. ' ' .. at)
  return type(time) == 'table' and now or time  -- a table: the key has another type
end
local function is_untried(name)
  for _, other in ipairs(others) do
    if not failure(name, other) then return true end
  end
  return false
end
local function hand_out(message, deliveries)
  local name = name_of(message)
  redis.pcall('HSET', taken, name, message[1] .. ' ' .. worker .. ' ' .. now)
  return {'unit', message[1], name, deliveries, #others}
end
local function new()
  local streams = redis.call('XREADGROUP', 'GROUP', 'bakers', worker, 'COUNT', 1, 'STREAMS', units, '>')
  return streams and streams[1][2][1]
end
local message = new()
if message then return hand_out(message, 1) end
local from, skipped = '0-0', 0
repeat
  local claimed = redis.call('XAUTOCLAIM', units, 'bakers', worker, lease, from, 'COUNT', 1)
  from = claimed[1]
  message = claimed[2][1]
  if message then
    local deliveries = redis.call('XPENDING', units, 'bakers', message[1], message[1], 1)[1][4]
    local name = name_of(message)
    local time = failure(name, worker)
    local is_open = redis.pcall('HEXISTS', errors, name) == 1 and (not time or is_untried(name))
    if not (is_open and time and is_recent(time)) then
      if is_open and deliveries <= 3 * attempts then deliveries = math.min(deliveries, attempts - 1) end
      return hand_out(message, deliveries)
    end
    redis.call('XCLAIM', units, 'bakers', '-', 0, message[1], 'IDLE', lease, 'RETRYCOUNT', deliveries - 1, 'JUSTID')
    skipped = skipped + 1
  end
until from == '0-0' or skipped == 500
if redis.call('XLEN', units) > 0 then return {'wait'} end
if redis.call('XLEN', dead) > 0 then return {'incomplete'} end
if redis.call('HGET', job, 'state') == 'finished' then return {'finished'} end
redis.call('XADD', units, '*', 'unit', '*finish')
return hand_out(new(), 1)
)lua";

// ARGV: incarnation, worker, ids. Renews the leases of those ids that this worker still holds.
inline constexpr const char* kBeat = R"lua(
redis.pcall('HSET', workers, ARGV[2], now_ms())
for i = 3, #ARGV do
  local pending = redis.call('XPENDING', units, 'bakers', ARGV[i], ARGV[i], 1)[1]
  if pending and pending[2] == ARGV[2] then
    redis.call('XCLAIM', units, 'bakers', ARGV[2], 0, ARGV[i], 'JUSTID')
  end
end
return {'ok'}
)lua";

// ARGV: incarnation, id, unit, worker, seconds. The unit may have been given up meanwhile, because its worker was
// silent. Its file exists now, so it is removed from the dead units.
inline constexpr const char* kDone = R"lua(
local is_new = remove(ARGV[2], ARGV[3])
for _, entry in ipairs(redis.call('XRANGE', dead, '-', '+')) do
  for i = 1, #entry[2], 2 do
    if entry[2][i] == 'unit' and entry[2][i + 1] == ARGV[3] then
      redis.call('XDEL', dead, entry[1])
      is_new = true
    end
  end
end
if is_new then
  redis.pcall('HDEL', errors, ARGV[3])
  redis.pcall('XADD', done, 'MAXLEN', '~', 1000, '*', 'unit', ARGV[3], 'worker', ARGV[4], 'seconds', ARGV[5])
end
return {'ok'}
)lua";

// ARGV: incarnation, id, unit, worker, why (empty: stopped), number of deliveries to count, initial idle time in ms.
inline constexpr const char* kGiveBack = R"lua(
local pending = redis.call('XPENDING', units, 'bakers', ARGV[2], ARGV[2], 1)[1]
if not pending or pending[2] ~= ARGV[4] then return {'ok'} end
if ARGV[5] ~= '' then
  redis.pcall('HSET', errors, ARGV[3], ARGV[5])
  redis.pcall('HSET', failed, ARGV[3] .. ' ' .. ARGV[4], now_ms())
end
redis.pcall('HDEL', taken, ARGV[3])
redis.call('XCLAIM', units, 'bakers', '-', 0, ARGV[2], 'IDLE', ARGV[7], 'RETRYCOUNT', ARGV[6], 'JUSTID')
return {'ok'}
)lua";

// ARGV: incarnation, id, unit, worker, why (empty: the last error that was noted), deliveries.
inline constexpr const char* kBury = R"lua(
local why = ARGV[5]
if why == '' then
  why = redis.pcall('HGET', errors, ARGV[3])
  if type(why) ~= 'string' then why = 'its workers ended before it was done: killed, out of memory, or cut off' end
end
if remove(ARGV[2], ARGV[3]) then
  redis.call('XADD', dead, '*', 'unit', ARGV[3], 'why', why, 'deliveries', ARGV[6], 'worker', ARGV[4])
end
redis.pcall('HDEL', errors, ARGV[3])
return {'ok'}
)lua";

// ARGV: incarnation, worker, which ends.
inline constexpr const char* kLeave = R"lua(
redis.pcall('HDEL', workers, ARGV[2])
return {'ok'}
)lua";

// ARGV: incarnation, id of the finishing unit, units whose files are missing.
inline constexpr const char* kAddMissing = R"lua(
for i = 3, #ARGV do redis.call('XADD', units, '*', 'unit', ARGV[i]) end
remove(ARGV[2], '*finish')
return {'ok'}
)lua";

// ARGV: incarnation, id of the finishing unit. A finished job is forgotten after a week.
inline constexpr const char* kFinished = R"lua(
redis.call('HSET', job, 'state', 'finished')
remove(ARGV[2], '*finish')
for i = 1, #KEYS do redis.call('EXPIRE', KEYS[i], 604800) end
return {'ok'}
)lua";

}  // namespace terrace::bake::scripts
